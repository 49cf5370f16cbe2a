"""What a scene's functions are made of: the graph of its right-hand side, and what is computed of its expressions.

Faces: `graph` (what a right-hand side may use), `tangent` (its derivatives), and of numbers, of lanes, or of
symbols when code is compiled: `series`, `hidden`, `rounding`, `stiff`. `codegen` makes functions of them; what is done
with these is generic (`integrate`).
"""
