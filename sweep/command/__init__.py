"""The commands: each a function with its help, options and an example. They call all rooms below and add nothing.

Others may use
    `options`         Command: how a command is declared; none overwrites a file without --force
    `reading`         what commands open and check; Outcome, explained: how one ended
    `solve`, `look`   the commands themselves: those that solve cells, and those that do not

A further command is a function that `sweep.cli` names.
"""
