"""The sweep engine: a study in, an xarray Dataset in an HDF5 file out."""
