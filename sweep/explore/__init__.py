"""What runs sweeps to learn something.

Others may use
    `plan`            what a study will take
    `work_precision`  error against time of every method of a kernel
    `refine`          cells where they are needed
    `notebook`        kernels; what a notebook shows of them and of a study
    `join`            two results as one
    `solver`          a study's kernel as a function of its axes
    `sensitivity`     which parameters decide an output
    `groups`          superfluous axes, outputs free of units
    `failing`         a study without the cells at which its kernel fails

Behind `refine` is `refiner` (rounds of cuts), behind `work_precision`
`reference` (what errors are against), behind `groups` `symmetries` (powers by which numbers may be multiplied).
"""
