"""The balance with viscous and solid friction.

Faces: `release` (ring-down), `trace` (turning points), `driven` (limit cycle).
"""
