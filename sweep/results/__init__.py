"""A finished or growing file as a Dataset: `open`, `stored`, `statuses`, `verify`, `filter`, `export`, `units`."""
