"""What stands at an output's place before a run: a result that is complete, parts to continue, or something else."""

from __future__ import annotations

from collections.abc import Mapping

from sweep.cells.fingerprint import difference
from sweep.cells.partition import row_blocks
from sweep.results.open import checked_study, stored_fingerprint
from sweep.runs.extend import has_failed, obstacle
from sweep.runs.task import Task
from sweep.store.manifest import Manifest, read_manifest, restored
from sweep.store.store import Store
from sweep.system.errors import SweepError

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
        check_whole(task)
        return not (task.retry_failed and has_failed(task.output))
    hindrance = obstacle(stored, task.fingerprint)
    if task.extend and not hindrance:
        return False
    cure = "choose another name, or overwrite it with --force"
    more = "" if hindrance else f"; {EXTENDABLE}"
    what = f"cannot be extended, for {hindrance}" if task.extend else "holds the result of another study or version"
    raise SweepError(f"{task.output}: {what}; {cure}{more}\n" + _listed(stored, task.fingerprint))


def check_whole(task: Task) -> None:
    """Raises SweepError where the result is damaged."""
    from sweep.results import verify

    verify.check_whole(task.output)


def earlier(store: Store, task: Task) -> Manifest | None:
    """What an earlier run left, if it can be read. Raises SweepError where it cannot, unless forced."""
    try:
        manifest = read_manifest(store.folder)
        if manifest is not None:
            checked_study(store.folder, manifest)
            return manifest
    except SweepError:
        manifest = None if task.force else _restored(store, task)
        if manifest is None and not task.force:
            raise
        return manifest
    return None if task.force else _restored(store, task)


def _restored(store: Store, task: Task) -> Manifest | None:
    """The manifest that is lost or damaged, written anew where the parts are of this study. Raises SweepError."""
    study = task.study
    manifest = restored(store.folder, store.columns, study.to_json(), task.fingerprint, row_blocks(study).count)
    if manifest is not None:
        store.write(manifest)
        task.note("its spec.json was lost or damaged; it is written anew")
    return manifest


def take_up(store: Store, manifest: Manifest | None, task: Task) -> None:
    """Continues what an earlier run left. Raises SweepError where that was another study, unless forced."""
    if manifest is not None and dict(manifest.fingerprint) == dict(task.fingerprint):
        store.resume(manifest)
    elif manifest is None and store.orphans() and not task.force:
        raise SweepError(
            f"{store.folder}: {store.orphans()} finished blocks, but no spec.json that says of which study; "
            "put it back, or give the blocks up with --force"
        )
    elif manifest is None or task.force:
        store.clear()
    else:
        raise SweepError(
            f"{store.folder}: unfinished parts of another study or version; finish that one first, choose another "
            "name, or give its parts up with --force\n" + _listed(manifest.fingerprint, task.fingerprint)
        )


def tidy(store: Store, manifest: Manifest | None, task: Task) -> None:
    """Removes parts that were left over although their output is complete; not those of another study."""
    if manifest is None or dict(manifest.fingerprint) == dict(task.fingerprint):
        store.clear()


def _listed(old: Mapping[str, str], new: Mapping[str, str]) -> str:
    return "\n".join(f"  {line}" for line in difference(dict(old), dict(new)))
