"""A study: TOML (or a dict) in, a checked `Study` out, all mistakes at once.

Faces: `model` (Study, Axis), `read` (read_study, build_study), `kernels` (kernel lookup), `mistakes`, `units` (the only
place that imports pint), `summary`, `spacing`.
"""
