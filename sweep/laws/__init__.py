"""Scaling laws of xarray objects; independent of studies, cells and files.

Others may use
    `exponents`  local exponents, where curves pass a value, maps of exponents
    `lines`      straight lines in log-log, corrections to scaling
    `two_laws`   two power laws with a crossover; where two straight lines meet; comparison of laws
    `collapse`   exponents of a scaling collapse
    `loglog`     is_logarithmic, spans_decades: whether an axis is drawn and interpolated in logarithms

Behind these: `loglog` (slopes and roots of plain arrays), `noise` (regression with noise of unknown kind), `shapes`
(the table of laws), `fits` (laws of the table fitted to points).
"""
