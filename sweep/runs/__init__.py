"""One run of a study, here or on a cluster: an executor computes blocks, which are stored.

Others may use
    `run`       run, complete
    `loop`      Task: the options of a run; Loop: times a sample, divides the grid, and has blocks computed;
                cores, endless
    `progress`  Progress: share done and time left; log, log_path, logging_to, read_lines: the log beside a
                result

Blocks are computed by threads here, or by the workers of a `cluster`, each on a bench; both may solve cells in separate
processes (`isolate`). `run` continues and stores a result; `extend` reuses cells of an earlier one.
"""
