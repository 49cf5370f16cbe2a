"""What stands at an output's place before a run: a result that is complete, one to continue, or something else."""

from __future__ import annotations

from collections.abc import Mapping

from sweep.cells.fingerprint import difference
from sweep.cells.output_schema import part_columns
from sweep.cells.partition import row_blocks
from sweep.errors import SweepError
from sweep.file.layout import Layout
from sweep.file.open import stored_fingerprint
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
    layout = _found(store, task)
    if layout is None and task.repair and not task.force and task.output.exists():
        store.reopen(verify(task.output).blocks or ())
    elif layout is None:
        store.discard()
    elif dict(layout.fingerprint) == dict(task.fingerprint) and _fits(layout, task):
        store.resume(layout)
    elif task.force:
        store.discard()
    else:
        raise SweepError(
            f"{store.path}: the unfinished result of another study or version; finish that one first, choose another "
            "name, or give it up with --force\n" + _listed(layout.fingerprint, task.fingerprint)
        )


def _found(store: Store, task: Task) -> Layout | None:
    """What an earlier run left; None where that is damaged and given up."""
    try:
        return store.found()
    except SweepError:
        if not task.force:
            raise
        return None


def _fits(layout: Layout, task: Task) -> bool:
    """Whether a file has the columns and rows of a study. Raises SweepError where it has not, unless forced."""
    columns = [(c.name, c.cell_bytes) for c in part_columns(task.study)]
    rows = row_blocks(task.study).count
    work = layout.work
    if [(p.name, p.cell_bytes) for p in work.places] == columns and work.blocks.size == rows:
        return True
    if task.force:
        return False
    raise SweepError(f"{task.output}: its unfinished result is not what its study makes; give it up with --force")


def tidy(store: Store, task: Task) -> None:
    """Removes what was left over although its output is complete; not that of another study."""
    layout = _found(store, task)
    if layout is not None and dict(layout.fingerprint) == dict(task.fingerprint):
        store.discard()


def _listed(old: Mapping[str, str], new: Mapping[str, str]) -> str:
    return "\n".join(f"  {line}" for line in difference(dict(old), dict(new)))
