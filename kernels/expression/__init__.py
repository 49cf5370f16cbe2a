"""The expression graph of a scene's functions, and computations on it.

Faces: `graph` (operations of a right-hand side), `tangent` (derivatives), and, for numbers, lanes, or symbols at
compile time, `series`, `hidden`, `rounding`, `stiff`. `codegen` makes functions of them, for the generic integrators of
`integrate`.
"""
