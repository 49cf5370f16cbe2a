"""A scene of one's own as compiled functions: recorded, turned into series or steps, followed to a tolerance.

Faces: `compiled` (what runs a scene by a method), `followed` (columns of cells by it), `to_tolerance`, `three_steps`
(fixed steps). Users come in by `kernels.scene` and `kernels.stepping`.
"""
