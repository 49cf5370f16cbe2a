"""Scaling laws: xarray in, xarray out. Knows neither studies nor cells nor files.

Others may use
    `exponents`  local exponents, where curves pass a value, exponents over two parameters
    `lines`      straight lines in log-log, corrections to scaling
    `two_laws`   two power laws with a bend, fitted at once; where two straight lines meet; which law of the table
    `collapse`   exponents of a collapse
    `loglog`     is_logarithmic, spans_decades: what an axis is drawn and interpolated by

Behind these: `loglog` (slopes and roots of plain arrays), `noise` (the one regression, whatever the noise), `shapes`
(the table of laws), `fits` (laws of the table fitted to points).
"""
