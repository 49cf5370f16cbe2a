"""A finished or growing file as a Dataset: `open`, `statuses`, `verify`, `filter`, `export`, `units`."""
