"""Ground floor of the engine: what any of its rooms may need. Knows no study and no result.

Others may use
    `errors`       SweepError, and the mistakes of a study
    `expected`     what a function refuses to be given
    `disk`         every call that changes the disk
    `pool`         many jobs through threads or workers; BufferPool, Stopper, CtrlC
    `progress`     how far a sweep has come, in words; when it is to stop
    `log`          the log of a run beside its output
    `forecast`     which block is next, and how long those to come take
    `overwriting`  what may be overwritten
    `table`        plain text in columns
"""
