"""The compiler and its vectors: everything numba is touched with. Ground floor; knows no scene and no mathematics.

Faces: `wiring` (physics of one cell in, a `Kernel` out), `records` (columns by name), `codes` (statuses as numbers),
`ranges` (outputs that no float64 can hold), `jit` (compiler options), `vectors` (cells side by side as a numba type,
and what can be done with them), `columns` (loops over columns of cells, in groups that share buffers, refilled; entries
for the engine), `tuples`, `symbols` (plain Python that is run when code is compiled), `addresses` (functions compiled
when a cell asks for them first). Within: `inlining` (functions that are compiled only into what calls them), `cache`
(machine code on the disk).
"""
