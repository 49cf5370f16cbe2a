"""Where a block becomes durable: nothing acknowledged is lost. The only room that writes HDF5.

Faces: `store`, `parts`, `manifest`, `digests`, `seal`, `assemble`, `hdf5_bytes`, `canvas`.
"""
