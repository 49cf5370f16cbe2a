"""Tools that run sweeps of their own: forecasts, charts, refinement, checks.

Others may use
    `plan`            forecast of a run
    `work_precision`  error against time of every method of a kernel
    `refine`          adaptive refinement of a grid
    `scattered`       interpolation between scattered cells; those cells that lie on lines
    `solver`          a study's kernel as a function of its axes
    `recheck`         one cell solved again by each method; a sample of OK cells checked to rtol
    `sensitivity`     global sensitivity indices of an output
    `scaling`         superfluous axes, dimensionless groups

Behind `refine` is `mesh` (simplices of cells, and the error of linear interpolation in them).
"""
