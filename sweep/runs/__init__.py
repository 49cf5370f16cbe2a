"""One run of a study: faces `run`, `session`, `extend`; `cluster`, `dispatch` and `worker` on dask."""
