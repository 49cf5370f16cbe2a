"""Scaling laws: xarray in, xarray out. Knows neither studies nor cells nor files.

Others may use
    `exponents`  local exponents, where curves pass a value
    `lines`      straight lines in log-log, in one window or ever smaller ones; where two of them meet
    `two_laws`   two power laws with a bend, fitted at once
    `compare`    which law: one, two, three, a logarithm, an offset, a correction to scaling
    `asymptote`  corrections to scaling
    `collapse`   exponents of a collapse
    `maps`       exponents over two parameters, borders as lines
    `curves`     stated_error: what a result says its values are right to
    `loglog`     is_logarithmic, spans_decades: what an axis is drawn and interpolated by

Behind these: `loglog` (slopes, lines and roots of plain arrays), `scatter` and `correlated` (error bars of lines),
`shapes` (the laws that are compared). What needs statsmodels or lmfit says so: extra `fit`.
"""
