"""Mathematics, independent of models: the same source for one cell and for lanes, with the same bits in both.

Faces: `elementary` (exp, log, sin, power ... as polynomials), `pairs` (32-digit arithmetic), `wide` (numbers beyond the
range of float64), `complex`, `cubic`, `roots` (of any equation), `quadrature`, `philox` (random numbers by counter),
`decimals` (exact tables).
"""
