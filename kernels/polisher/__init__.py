"""The polishing machine's arm: `arm` (extreme angles, rates, distortion), `motion` (over a turn).

`linkage` and `extremes` are also what the room `wear` builds on.
"""
