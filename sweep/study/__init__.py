"""From TOML, or a dict, to a checked `Study`, all mistakes told at once.

Faces: `model` (Study, Axis), `read` (read_study, build_study), `kernels` (kernel lookup), `mistakes`, `units` (the only
place that imports pint), `summary`, `spacing`.
"""
