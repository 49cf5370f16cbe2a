"""The commands: each with its options and the function that does it. They call all rooms below and add nothing.

Others may use
    `options`  Command, Option: how a command is declared
    `outcome`  Outcome, explained: how it ended
    `offered`, `exploring`, `running`, `looking`, `laws`, `writing`   COMMANDS: those of this module, by name

`files` opens and checks what a command reads and writes. To add a command, write its function and one row of COMMANDS.
"""
