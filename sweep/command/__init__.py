"""The commands: each a function with its help, options and an example. They call all rooms below and add nothing.

Others may use
    `options`         Command: how a command is declared; none overwrites a file without --force
    `outcome`         Outcome, explained: how it ended
    `solve`, `look`   the commands themselves: those that solve cells, and those that do not

`reading` opens and checks what commands read. A further command is a function that `sweep.cli` names.
"""
