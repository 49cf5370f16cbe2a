"""The verge and foliot: friction of any law, hairspring, restitution; one public module a kernel.

Faces: `cycle` (kernel foliot), `motion`, `start`, `ripple`, `noise`, `design`, `steps`. Private parts begin with `_`:
`_units` makes the scene free of units, every method answers in those.
"""
