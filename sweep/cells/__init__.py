"""The grid of cells, its division into blocks, and the solution of a cell. Nothing here touches files.

Others may use
    `grid`         Grid: the cells of a study
    `partition`    blocks of cells, and row blocks, which a summary reduces to one row
    `timing`       a timed sample of the grid, which decides the size of blocks; compile times
    `sample`       some cells of a study as a study of their own
    `schema`       columns and attributes of a result, after the CF conventions
    `solve`        Solver: solves cells by the study's method or by the cheapest; methods that can solve a study
    `reduce`       variables of a result of cells or of a summary; Reducer: cells to rows, rows to one
    `block`        blocks of a study; Bench: computes one block; Guard: finds the cell that makes a kernel fail
    `fingerprint`  everything that determines the numbers, and differences between two of them
"""
