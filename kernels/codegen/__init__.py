"""A scene of one's own as compiled functions: recorded, turned into series or steps, followed to a tolerance.

Faces: `module` (the compiled scene), `stated_error`, `followed_twice` (to a tolerance), `stepped`, `three_steps`
(fixed steps). Users come in by `kernels.scene` and `kernels.stepping`.
"""
