"""What runs sweeps to learn something.

Others may use
    `plan`            what a study will take
    `work_precision`  error against time of every method of a kernel
    `refine`          cells where they are needed
    `scattered`       values between cells that lie anywhere in a box, and those of them that lie on lines
    `solver`          a study's kernel as a function of its axes
    `recheck`         one cell solved again by each method; a sample of OK cells, to see whether they are right to rtol
    `sensitivity`     which parameters decide an output
    `scaling`         superfluous axes, outputs free of units

Behind `refine` is `mesh` (cells joined to simplices, how far lines in them are off).
"""
