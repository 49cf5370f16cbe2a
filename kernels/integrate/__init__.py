"""Integration of any scene in time: exact linear flow, Runge-Kutta steps, Taylor series, and location of switches.

Faces: `linear_flow` (closed form of a damped, sprung mass), `tableaux`, `steps`, `pairs`, `rosenbrock`, `events`,
`taylor`; the legs of a scene of your own, `taylor_leg` with `powers` and `carried`, `adaptive`, `fixed_step`; `driver`,
which joins the legs; and `records`, which they exchange.
"""
