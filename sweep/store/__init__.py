"""Where a block becomes durable: nothing acknowledged is lost. The only room that writes HDF5.

Faces: `store`, `parts`, `manifest`, `digests`, `probe`, `assemble`, `hdf5_bytes`.
"""
