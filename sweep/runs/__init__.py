"""One run of a study, here or on a cluster: `run` is what others may use.

A `task` is what was asked for; `to_file` keeps its blocks in a store; `resume` looks at what stands at its place
already; a `session` computes blocks on threads, or has `dispatch` do it, which gives them to a `worker` of
a `cluster`. `extend` reuses cells. Where cells are `isolate`d, they are solved in processes that do what
`isolated` says. `pool` has threads and signals, `progress` and `forecast` what is told of the time, `bar` the bar of a
notebook, `log` the log beside a result.
"""
