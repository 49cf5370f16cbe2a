"""Motion of any scene over time: exact linear flow, explicit steps, Taylor series, and where a switch is met.

Faces: `linear_flow` (closed form of a damped, sprung mass), `tableaux`, `steps`, `pairs`, `fixed_step`,
`adaptive`, `taylor`, `events`, and `records`, what travels between them. What is written for a scene of one's own uses
these same functions.
"""
