"""Results for people: `charts` (the only place that imports matplotlib), `text`, `page` (HTML), `laws`, `kernels`."""
