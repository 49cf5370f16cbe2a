"""A grid of cells, how it is cut, and how a cell is solved; nothing here touches a file.

Faces: `grid`, `partition` (blocks), `row_blocks`, `schema` and `contents` (what a result holds), `solve`, `reduce`,
`fingerprint`, `sample`.
"""
