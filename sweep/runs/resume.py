"""What stands at an output's place before a run: a result that is complete, one to continue, or something else."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sweep.cells.fingerprint import difference
from sweep.cells.output_schema import part_columns
from sweep.cells.partition import row_blocks
from sweep.errors import SweepError
from sweep.file.open import stored_fingerprint
from sweep.file.reading import StoredFile
from sweep.file.store import Store
from sweep.file.verify import check_whole, verify
from sweep.runs.extend import has_failed, obstacle
from sweep.runs.task import Task

EXTENDABLE = (
    "where its axes have only got more values, --extend computes the new cells alone; those of another version it "
    "keeps if a sample of them still has the same bits"
)


def is_complete(task: Task) -> bool:
    """Whether the output is complete for this study. Raises SweepError where it is something else."""
    if not task.output.exists():
        return False
    stored = stored_fingerprint(task.output)
    if task.force:
        return False
    if stored == dict(task.fingerprint):
        if task.repair and verify(task.output).blocks is not None:
            return False
        check_whole(task.output)
        return not (task.retry_failed and has_failed(task.output))
    hindrance = obstacle(stored, task.fingerprint)
    if task.extend and not hindrance:
        return False
    cure = "choose another name, or overwrite it with --force"
    more = "" if hindrance else f"; {EXTENDABLE}"
    what = f"cannot be extended, for {hindrance}" if task.extend else "holds the result of another study or version"
    raise SweepError(f"{task.output}: {what}; {cure}{more}\n" + _listed(stored, task.fingerprint))


def take_up(store: Store, task: Task) -> None:
    """Continues what an earlier run left. Raises SweepError where that was another study, unless forced."""
    left = _found(store, task)
    if left is None and task.repair and not task.force and task.output.exists():
        store.reopen(verify(task.output).blocks or ())
    elif left is None:
        store.discard()
    elif left.fingerprint == dict(task.fingerprint) and _fits(left, task):
        store.resume(left)
    elif task.force:
        left.close()
        store.discard()
    else:
        raise SweepError(
            f"{store.path}: the unfinished result of another study or version; finish that one first, choose another "
            "name, or give it up with --force\n" + _listed(left.fingerprint, task.fingerprint)
        )


def _found(store: Store, task: Task) -> StoredFile | None:
    """What an earlier run left; None where that is damaged and given up."""
    try:
        return store.found()
    except SweepError:
        if not task.force:
            raise
        return None


def _fits(left: StoredFile, task: Task) -> bool:
    """Whether a file has the columns and rows of a study. Raises SweepError where it has not, unless forced."""
    columns = [(c.name, np.dtype(c.dtype), c.shape) for c in part_columns(task.study)]
    table = left.tables[left.work]
    found = [(p.name, np.dtype(p.dtype), p.shape) for p in table.places]
    if found == columns and table.blocks.size == row_blocks(task.study).count:
        return True
    if task.force:
        return False
    raise SweepError(f"{task.output}: its unfinished result is not what its study makes; give it up with --force")


def tidy(store: Store, task: Task) -> None:
    """Removes what was left over although its output is complete; not that of another study."""
    left = _found(store, task)
    if left is not None and left.fingerprint == dict(task.fingerprint):
        store.discard()


def _listed(old: Mapping[str, str], new: Mapping[str, str]) -> str:
    return "\n".join(f"  {line}" for line in difference(dict(old), dict(new)))
