"""Where a block becomes durable: one file, written in place. The only room that writes HDF5.

A result is one HDF5 file from its beginning, OUT.h5.unfinished, which is renamed when it is complete. HDF5 makes all of
it before the first number, with a place for each chunk of each column, one a block of the sweep (`frame`). Then
threads, and workers elsewhere that see the file, write blocks to their places, with HDF5's own checksum behind each
chunk. When their bytes are on the disk, digests of their chunks are written to a table in the file, many blocks at a
time: what has its digests is there, whatever happens (`store`). Blocks of an earlier run are compared with their
digests before new ones are computed, and damaged ones computed again. Of a summary, rows of reductions are kept in the
same way, and its columns made from them, at the end for all programs, before for whoever opens it here. What is not
computed yet is PENDING, and an error to whoever asks HDF5 for its numbers. All that reads a result compares it with its
digests (`reading`).

`open` gives a file as a Dataset (its arrays are `columns`), says what in it is damaged, or writes one of cells that are
known. All calls that change the disk are in `disk`, which also refuses to overwrite what is there already, unless that
is forced.
"""
