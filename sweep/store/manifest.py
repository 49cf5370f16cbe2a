"""spec.json: what a sweep that is not finished was begun with.

It ends with a digest of itself. Parts are of the sweep whose fingerprint their digests begin with, so that a manifest
that is lost or damaged is written anew from a study and the parts that prove to be its own.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import xxhash

from sweep.cells.partition import Partition
from sweep.cells.schema import Column
from sweep.store.hdf5_bytes import PartBytes
from sweep.store.parts import PART_NAME, is_sound
from sweep.system.errors import SweepError

FORMAT = 2
MANIFEST = "spec.json"


@dataclass(frozen=True)
class Manifest:
    """What spec.json says: all that a sweep needs to be continued or read."""

    study: str
    fingerprint: Mapping[str, str]
    blocks: Partition
    begun: str

    @property
    def mark(self) -> bytes:
        """What the digests of this sweep's parts begin with."""
        return xxhash.xxh3_128(json.dumps(dict(self.fingerprint), sort_keys=True).encode()).digest()

    def to_json(self) -> str:
        """The text of spec.json."""
        keys = {
            "format": FORMAT,
            "cells": self.blocks.size,
            "cells_per_block": self.blocks.cells,
            "begun": self.begun,
            "fingerprint": dict(self.fingerprint),
            "study": self.study,
        }
        return json.dumps({**keys, "digest": _digest(keys)}, indent=1)


def new_manifest(study: str, fingerprint: Mapping[str, str], blocks: Partition) -> Manifest:
    """The manifest of a sweep that begins now."""
    return Manifest(study, fingerprint, blocks, datetime.now(UTC).isoformat(timespec="seconds"))


def read_manifest(folder: Path) -> Manifest | None:
    """The manifest of a sweep that has not ended, or None where there is none. Raises SweepError."""
    path = folder / MANIFEST
    try:
        if path.exists() and not path.is_file():
            raise ValueError("it is no regular file")
        keys = json.loads(path.read_text("utf-8"))
        if keys["format"] != FORMAT:
            raise SweepError(f"{path}: format {keys['format']}; this version of foliot reads format {FORMAT}")
        if keys.pop("digest") != _digest(keys):
            raise ValueError("its digest differs")
        blocks = Partition(int(keys["cells"]), int(keys["cells_per_block"]))
        return Manifest(keys["study"], keys["fingerprint"], blocks, keys["begun"])
    except FileNotFoundError:
        return None
    except OSError as fault:
        raise SweepError(f"{path}: cannot be read ({fault.strerror})") from None
    except (ValueError, KeyError, TypeError, RecursionError, AttributeError) as fault:
        raise SweepError(
            f"{path}: damaged ({fault}); run its study again to have it written anew, or remove the folder {folder} "
            "to start anew"
        ) from None


def _digest(keys: Mapping[str, Any]) -> str:
    return xxhash.xxh3_128(json.dumps(keys).encode()).hexdigest()


def restored(
    folder: Path, columns: Sequence[Column], study: str, fingerprint: Mapping[str, str], rows: int
) -> Manifest | None:
    """The manifest that a lost one was, where there are parts of just this study; None where there are none."""
    found = [match for entry in os.scandir(folder) if (match := PART_NAME.fullmatch(entry.name))]
    counts = Counter(int(match[2]) - int(match[1]) for match in found)
    if not counts:
        return None
    # all but the last are equally long
    usual = max(counts, key=lambda cells: (counts[cells], cells))
    manifest = new_manifest(study, fingerprint, Partition(rows, max(1, usual)))
    part_bytes = PartBytes(columns, manifest.mark)
    names = [match[0] for match in found if manifest.blocks.holds(int(match[1]), int(match[2]))]
    return manifest if any(is_sound(folder / name, part_bytes) for name in names) else None
