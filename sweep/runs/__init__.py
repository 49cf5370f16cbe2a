"""One run of a study, here or on a cluster: a loop has an executor compute blocks, which are kept.

Others may use
    `run`       run, complete
    `loop`      Task, Loop: what a run was asked for, and its beginning: a timed sample, the grid cut into blocks;
                cores, endless
    `progress`  Progress: how far it is, and how long it will take; log, log_path, logging_to, read_lines: the log
                beside a result

`loop` takes what was asked for, times a sample, cuts the grid, and has blocks computed, each on a bench: by threads
here, or by the workers of a `cluster`; both may have cells solved in processes of their own, by `isolate`. `run`
continues and keeps what is computed; `extend` reuses cells.
"""
