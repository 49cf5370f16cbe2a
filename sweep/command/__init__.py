"""The commands: each a function with its help, options and an example. They call all rooms below and add nothing.

Others may use
    `options`   Command: how a command is declared
    `outcome`   Outcome, explained: how it ended
    `offer`, `explore`, `run`, `look`, `laws`, `write`   the commands themselves

`reading` opens and checks what commands read and write. A further command is a function that `sweep.cli` names.
"""
