"""The commands of `sweep`: each a function with its help, options and an example, which calls the rooms below.

Others may use
    `options`         Command: the declaration of a command; none overwrites a file without --force
    `reading`         opens and checks what commands read; Outcome, explained: how a command ended
    `solve`, `look`   the commands themselves: those that solve cells, and those that do not

A new command is a function that is named in `sweep.cli`.
"""
