"""Scaling laws: xarray in, xarray out. Knows neither studies nor cells nor files.

Others may use
    `exponents`  local exponents, straight lines in log-log, where curves pass a value
    `two_laws`   two power laws with a bend, fitted at once
    `maps`       exponents over two parameters, borders as lines
    `scattered`  values between the cells of a refined result
    `loglog`     is_logarithmic, spans_decades: what an axis is drawn and interpolated by

`curves` and the rest of `loglog` (slopes, lines and roots of plain arrays) are behind these.
"""
