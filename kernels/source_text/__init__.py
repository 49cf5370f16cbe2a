"""What a scene's module is written from: the graph of its right-hand side, and the source text of its expressions.

Faces: `expression` (what a right-hand side may use), `tangent` (its derivatives), `template`, and what is written:
`series`, `hidden`, `rounding`, `stiff`. `codegen` puts it together; what is done with it is generic (`integrate`).
"""
