"""Ground floor of the engine: errors, words, disk, threads, progress, tables. Knows no study and no result."""
