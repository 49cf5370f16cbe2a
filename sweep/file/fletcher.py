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
CHECKSUM_BYTES = 4
NUMBERS = np.arange(ROW, dtype=np.uint64)


def checksum(piece: Any, length: int) -> bytes:
    """What stands in a file behind a chunk of so many bytes: those of `piece`, then zeros."""
    raw = np.frombuffer(as_bytes(piece), np.uint8)
    words = raw[: raw.size // 2 * 2].view("<u2")
    low, high = _sums(words)
    count = words.size
    if raw.size % 2:
        low, high, count = low + int(raw[-1]), high + low + int(raw[-1]), count + 1
    high += (-(-length // 2) - count) * low
    found = _folded(high) << 16 | _folded(low)
    return found.to_bytes(CHECKSUM_BYTES, "little")


def _folded(total: int) -> int:
    """256 times a sum modulo 65535, as HDF5 has it: 0 stands for a sum that is zero itself."""
    return 256 * total % MODULUS or (MODULUS if total else 0)


def _sums(words: Any) -> tuple[int, int]:
    """The sum of words, and their sum by how many there are from each to the end."""
    low = high = 0
    whole = words.size // ROW
    for first in range(0, whole, MOST_ROWS):
        rows = words[first * ROW : min(first + MOST_ROWS, whole) * ROW].reshape(-1, ROW)
        low, high = _behind(low, high, rows.size, *_sums_of_rows(rows))
    rest = words[whole * ROW :].astype(np.uint64)
    weighted = int(rest @ (np.uint64(rest.size) - NUMBERS[: rest.size]))
    return _behind(low, high, rest.size, int(rest.sum()), weighted)


def _behind(low: int, high: int, count: int, low_behind: int, high_behind: int) -> tuple[int, int]:
    """The sums of words with `count` others behind them."""
    return low + low_behind, high + count * low + high_behind


def _sums_of_rows(rows: Any) -> tuple[int, int]:
    by_row = rows.sum(axis=1, dtype=np.uint32).astype(np.uint64)
    by_column = rows.sum(axis=0, dtype=np.uint32).astype(np.uint64)
    low = int(by_row.sum())
    numbered = ROW * int(by_row @ np.arange(len(rows), dtype=np.uint64)) + int(by_column @ NUMBERS)
    return low, rows.size * low - numbered
