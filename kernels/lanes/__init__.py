"""The compiler and its vectors: everything that uses numba. The lowest room; it has neither models nor mathematics.

Faces: `wiring` (makes a `Kernel` from the physics of one cell), `records` (columns by name), `codes` (statuses as
numbers), `ranges` (outputs outside the range of float64), `jit` (compiler options), `vectors` (cells side by side as a
numba type, with their operations), `columns` (loops over columns of cells, also in groups that share buffers, or
refilled; entries for the engine), `tuples`, `symbols` (plain Python that is run at compile time), `addresses`
(functions compiled on first use). Internal: `inlining` (functions that are compiled only into their callers), `cache`
(machine code on the disk).
"""
