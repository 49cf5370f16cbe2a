"""Scaling laws: xarray in, xarray out; knows neither studies nor files.

Faces: `exponents`, `two_laws`, `maps`, `curves`, `loglog` (plain arrays).
"""
