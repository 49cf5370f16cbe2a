"""HDF5's checksum of a chunk (its filter fletcher32), by sums of rows and columns that numpy takes at memory speed.

Of big-endian words w[0] .. w[n-1] of 16 bits it is (sum of w[i], sum of (n - i) w[i]) modulo 65535. As 2^16 is 1 there,
a word with its bytes swapped is 256 times the word. And with the words in rows of K, sum of i w[i] is K times the sum
of row numbers by sums of rows, and the sum of column numbers by sums of columns.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sweep.file.disk import as_bytes

MODULUS = 65535
ROW = 4096
"""Words of a row; what is left of a chunk behind whole rows is summed word by word."""
MOST_ROWS = 1 << 12
"""Rows summed at a time, so that 32 bits hold each sum."""
NUMBERS = np.arange(ROW, dtype=np.uint64)


def checksum(piece: Any, length: int) -> bytes:
    """The four bytes behind a chunk of so many bytes: those of `piece`, then zeros."""
    raw = np.frombuffer(as_bytes(piece), np.uint8)
    words = raw[: raw.size // 2 * 2].view("<u2")
    whole = words.size // ROW
    low = high = 0
    for first in range(0, whole, MOST_ROWS):
        rows = words[first * ROW : min(first + MOST_ROWS, whole) * ROW].reshape(-1, ROW)
        by_row = rows.sum(axis=1, dtype=np.uint32).astype(np.uint64)
        by_column = rows.sum(axis=0, dtype=np.uint32).astype(np.uint64)
        more = int(by_row.sum())
        numbered = ROW * int(by_row @ np.arange(len(rows), dtype=np.uint64)) + int(by_column @ NUMBERS)
        high += rows.size * (low + more) - numbered
        low += more
    rest = words[whole * ROW :].astype(np.uint64)
    high += rest.size * low + int(rest @ (np.uint64(rest.size) - NUMBERS[: rest.size]))
    low += int(rest.sum())
    if raw.size % 2:
        low += int(raw[-1])
        high += low
    high += (-(-length // 2) - -(-raw.size // 2)) * low
    # 256 times a sum modulo 65535, as HDF5 has it: 0 stands for a sum that is zero itself
    first, second = (256 * total % MODULUS or (MODULUS if total else 0) for total in (low, high))
    return (second << 16 | first).to_bytes(4, "little")
