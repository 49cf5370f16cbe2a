"""The compiler and its vectors: everything numba is touched with. Ground floor; knows no scene and no mathematics.

Faces: `jit` (compiler options), `vectors` (32 cells as a numba type, and what can be done with them), `columns` (loops
over columns of cells, entries for the engine), `refill` (lanes that take the next cell when one is done), `groups`,
`tuples`, `inlining` (functions compiled by parts), `cache` (machine code on the disk).
"""
