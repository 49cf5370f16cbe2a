"""The file of a result, written in place, block by block. The only room that writes HDF5.

A result is one HDF5 file from its beginning, OUT.h5.unfinished, which is renamed when it is complete. HDF5 lays out
the complete file before the first number, with a chunk of each column for each block of the sweep (`frame`). Threads,
and workers elsewhere that see the file, then write blocks to their places, with HDF5's own checksum behind each chunk.
Once the bytes are on the disk, digests of the chunks are written to a table in the file, for many blocks at a time: a
block whose digests are in the table is safe (`store`). Blocks of an earlier run are compared with their digests, and
damaged ones computed again. For a summary, rows of reductions are stored in the same way; its columns are computed from
them, at the end, or earlier when the file is opened here. Cells that are not computed yet are PENDING, and HDF5 reports
an error for their numbers. Everything that reads a result compares it with its digests (`reading`).

`open` opens a file as a Dataset (its arrays are `columns`), reports damage, or writes a file of existing cells. All
calls that change the disk are in `disk`, which also refuses to overwrite existing files unless forced.
"""
