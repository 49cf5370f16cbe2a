"""A scene of one's own written out as compiled functions: recorded, turned into series or steps, saved, imported.

Faces: `module` (the written file), `stated_error`, `followed_twice` (to a tolerance), `stepped`, `three_steps`
(fixed steps). Users come in by `kernels.scene` and `kernels.stepping`.
"""
