"""A finished or growing file as a Dataset.

Others may use `open`, `stored`, `statuses`, `verify`, `filter`, `export`, `units`, `diff`, `listing`.
"""
