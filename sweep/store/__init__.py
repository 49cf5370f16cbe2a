"""Where a block becomes durable: nothing acknowledged is lost. The only room that writes HDF5.

Others may use
    `store`       Store: the parts of a sweep that is not finished, and their lock
    `manifest`    what such a sweep was begun with
    `parts`       one finished block as a file
    `assemble`    from parts to one file
    `digests`     by which damage to that file is found
    `probe`       whether HDF5 can be let loose on a file
    `hdf5_bytes`  a file that HDF5 writes without ever failing, and parts as bytes
"""
