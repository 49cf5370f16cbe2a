"""Compiles a scene of your own: records it, makes series or steps of it, and solves it to a tolerance.

Faces: `compiled` (runs a scene by a method), `followed` (columns of cells), `to_tolerance`, `three_steps` (fixed
steps). The public interface is in `kernels.scene` and `kernels.stepping`.
"""
