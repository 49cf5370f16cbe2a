"""Motion of any scene over time: exact linear flow, explicit steps, Taylor series, and where a switch is met.

Faces: `linear_flow` (closed form of a damped, sprung mass), `tableaux`, `steps`, `pairs`, `rosenbrock`, `events`,
`taylor`; the legs of a scene of one's own, `taylor_leg` with `powers` and `carried`, `adaptive`; `driver`, which
follows one after the other, `fixed_step`; and `records`, what travels between them.
"""
