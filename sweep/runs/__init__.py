"""One run of a study: `run` (the front), `session` (its blocks), `cluster` and `worker` (dask), `extend`."""
