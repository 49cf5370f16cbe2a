"""A grid of cells, how it is cut, and how a cell is solved. Nothing here touches a result's file.

Others may use
    `grid`         Grid: the cells of a study
    `partition`    blocks of cells, and row blocks, which a summary reduces to one row
    `timing`       a timed sample of the grid, and blocks of a size that follows from it; what compiling takes
    `sample`       some cells of a study as a study of their own
    `schema`       what a result of cells holds, as CF names it
    `solve`        Solver: one cell, by the method asked for or by the cheapest; which methods may solve a study
    `reduce`       what any result holds, of cells or a summary; Reducer: cells to rows, rows to one
    `block`        a study cut into blocks; Bench: where one of them is computed; Guard: a bad cell costs one cell
    `fingerprint`  what decides the numbers, and in what two of them differ
"""
