"""Runs that are killed, and files that are damaged, at random; shared by tests and the soak scripts."""

from __future__ import annotations

import io
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np
import xxhash

HERE = Path(__file__)
sys.path[:0] = [p for p in (str(HERE.parent), str(HERE.parents[2])) if p not in sys.path]

import sweep  # noqa: E402
from sweep.results.open import open_result  # noqa: E402
from sweep.results.verify import verify  # noqa: E402
from sweep.runs.run import run  # noqa: E402
from sweep.store import store as storing  # noqa: E402
from sweep.store.reading import StoredFile  # noqa: E402
from sweep.store.store import Store, unfinished_of  # noqa: E402
from sweep.study.read import build_study  # noqa: E402
from sweep.system.errors import SweepError  # noqa: E402

CELLS = 3000
PATIENCE = 900.0
"""Seconds that a run may take that is not killed, on a machine that does much else."""
KINDS = ("plain", "extend", "summary", "refine")


def study(cells=CELLS, every=1, speeds=(0.0, 1.0, -1.0), **keys):
    """A stone thrown from many heights, its way traced."""
    axes = {"height": np.linspace(1.0, 50.0, cells // 3)[::every], "v0": list(speeds)}
    keys = {"outputs": ["fall_time", "drop"], "along": {"phase": [0.0, 0.5]}, **keys}
    return build_study(kernel="toy:KERNEL", allow_import=True, axes=axes, **keys)


def few():
    """What is refined."""
    return study(90, speeds=(-1.0, 0.0, 1.0), outputs=["fall_time"], along={})


def base_of(output):
    """The finished result that a run of its kind begins with."""
    return output.with_name("base.h5")


def perform(kind, output, workers, cells):
    """A run of some kind to its end."""
    keys = {"workers": workers, "progress": False, "block_cells": cells}
    if kind == "refine":
        with open_result(base_of(output)) as found:
            sweep.refine(found, "fall_time", 1e-3, path=output, study=few(), workers=workers)
    elif kind == "summary":
        over = {"over": ["height"], "outputs": {"fall_time": ["min", "mean", "argmax"], "drop": ["mean"]}}
        run(study(summary=over), output, **keys).close()
    else:
        run(study(), output, extend=kind == "extend", **keys).close()


def prepare(kind, output):
    """Makes what a run of some kind begins with."""
    if kind == "extend":
        run(study(every=2), output, workers=1, progress=False).close()
    if kind == "refine" and not base_of(output).exists():
        run(few(), base_of(output), workers=1, progress=False).close()


def numbers(path):
    """Digest of all that a finished result holds but times and what hangs on the blocks."""
    state = xxhash.xxh3_128()
    with open_result(path, strict=True) as found:
        for name in [*found.data_vars, *found.coords]:
            state.update(name.encode() + np.ascontiguousarray(found[name].values).tobytes())
    return state.hexdigest()


def done(output):
    """Blocks of an unfinished result that are acknowledged."""
    with StoredFile(unfinished_of(output)) as file:
        return set(np.flatnonzero(file.done(file.layout.work_name)).tolist())


class Victims:
    """Runs in processes that are killed, forked off one that has imported everything. To be used in a `with`."""

    def __enter__(self):
        words = [sys.executable, str(HERE)]
        self._parent = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        return self

    def __exit__(self, *fault):
        self._parent.stdin.close()
        self._parent.wait()
        self._parent.stdout.close()

    def run(self, kind, output, workers, cells, seconds):
        """Whether the run came to its end before it was killed, after so many seconds; and what it acknowledged."""
        log = output.with_name("acknowledged")
        log.write_text("")
        self._parent.stdin.write(json.dumps([kind, str(output), workers, cells, str(log), seconds]) + "\n")
        self._parent.stdin.flush()
        ended = self._parent.stdout.readline().strip()
        assert ended in ("0", "9"), log.with_name("fault").read_text()
        return ended == "0", set(map(int, log.read_text().split()))


def torture(rng, victims, folder, kills, shapes, kinds=KINDS):
    """Kills runs at random moments, each continued until it ends.

    Returns
    -------
    dict
        "kills", "runs" that came to their end, "acknowledged" blocks of those that were killed, and of these "lost";
        "different": ends with other bits; "stages": what there was when a run was killed.
    """
    found = {"kills": 0, "runs": 0, "acknowledged": 0, "lost": 0, "different": 0, "stages": Counter()}
    whole, usual = {}, {}
    for kind in kinds:
        output = folder / f"{kind}.h5"
        for _ in range(2):  # the first one may wait for its parent
            prepare(kind, output)
            begun = time.monotonic()
            assert victims.run(kind, output, 2, 100, PATIENCE)[0]
            usual[kind] = time.monotonic() - begun
            whole[kind] = numbers(output)
            output.unlink()
    while found["kills"] < kills:
        kind = kinds[found["runs"] % len(kinds)]
        _tortured(rng, victims, folder / f"out{found['runs']}.h5", kind, rng.choice(shapes), usual, found)
        output = folder / f"out{found['runs']}.h5"
        found["runs"] += 1
        left = sorted(path.name for path in folder.iterdir() if path.name.startswith(output.name))
        found["different"] += numbers(output) != whole[kind] or left != [output.name] or not verify(output).whole
        output.unlink()
    return found


def _tortured(rng, victims, output, kind, cells, usual, found):
    """One run, killed again and again until it ends; `usual` seconds of each kind are kept in step with the machine."""
    prepare(kind, output)
    ended, kept, seconds = False, set(), usual[kind]
    while not ended:
        # as often near its end, where it is renamed, as before
        share = rng.random() if rng.random() < 0.5 else rng.uniform(0.8, 1.1)
        begun = time.monotonic()
        ended, acknowledged = victims.run(kind, output, rng.choice([1, 2, 8]), cells, share * seconds)
        if ended:
            usual[kind] = time.monotonic() - begun
        seconds *= 1.25
        kept |= acknowledged
        if not ended:
            found["kills"] += 1
            found["acknowledged"] += len(acknowledged)
            found["stages"][f"{kind}, {_stage(output)}"] += 1
            if unfinished_of(output).exists():
                found["lost"] += len(kept - done(output))
            # without it, the result is in its place, and has the right digest or not


def _stage(output):
    """How far a killed run had come."""
    if unfinished_of(output).exists():
        with StoredFile(unfinished_of(output)) as file:
            blocks = len(done(output))
            if file.finished:
                return "just before it was renamed"
            return "at its end" if blocks == file.layout.work.blocks.count else "at work" if blocks else "just begun"
    if unfinished_of(output).with_name(f"{output.name}.unfinished.tmp").exists():
        return "while its frame was written"
    return "before its frame, or at its very end"


def unfinished(output):
    """Stops the study when all is computed, and not ended."""
    real = Store.finish
    Store.finish = _stop
    try:
        run(study(), output, workers=1, block_cells=300, progress=False)
    except SweepError:
        return unfinished_of(output)
    finally:
        Store.finish = real


def _stop(*rest):
    raise SweepError("stopped")


DAMAGES = ("flip",) * 6 + ("zeroed",) * 4 + ("cut", "empty", "longer", "swapped", "swapped whole", "strange", "missing")


def damage(rng, path, strange):
    """Damages a result, finished or not, in some way; `strange` is one of another study. Tells what it did."""
    kind, content = rng.choice(DAMAGES), bytearray(path.read_bytes())
    with StoredFile(path) as file:
        table, endings = file.layout.work, file.layout.endings
        finished = file.finished
    block, other = rng.sample(range(table.blocks.count), 2)
    place = rng.choice(table.places)
    chunk = slice(place.at(block), place.at(block) + table.stored(place, block))
    if kind in ("flip", "zeroed"):
        length = 1 if kind == "flip" else 512
        at = rng.randrange(len(content) - length)
        if not finished and any(begin - length < at < end for begin, end in endings):
            return damage(rng, path, strange)  # what is written over at the end
        content[at : at + length] = bytes(length) if kind == "zeroed" else [content[at] ^ 1 << rng.randrange(8)]
    elif kind in ("cut", "empty", "missing"):
        content = content[: rng.randrange(len(content)) if kind == "cut" else 0]
    elif kind == "longer":
        content += rng.randbytes(100)
    else:
        rows = [slice(table.digests + b * table.row_bytes, table.digests + (b + 1) * table.row_bytes)
                for b in (block, other)]  # fmt: skip
        if kind == "swapped":
            there = slice(place.at(other), place.at(other) + table.stored(place, other))
            content[chunk], content[there] = content[there], content[chunk]
        elif kind == "swapped whole":
            for p in table.places:
                one, two = (slice(p.at(b), p.at(b) + table.stored(p, b)) for b in (block, other))
                content[one], content[two] = content[two], content[one]
            content[rows[0]], content[rows[1]] = content[rows[1]], content[rows[0]]
        else:
            for at in [*(slice(p.at(block), p.at(block) + table.stored(p, block)) for p in table.places), rows[0]]:
                content[at] = strange[at]
    path.unlink() if kind == "missing" else path.write_bytes(content)
    return kind


def damaged_unfinished(rng, path, strange, scratch, whole):
    """Damages a copy of an unfinished result; what kind, and what went wrong: "" where nothing did."""
    output = scratch / "out.h5"
    shutil.copy(path, unfinished_of(output))
    sound, log = verify(output).findings, io.StringIO()
    kind = damage(rng, unfinished_of(output), strange)
    wrong = []
    if kind != "missing" and unfinished_of(output).read_bytes() != path.read_bytes():
        wrong += ["not found"] if verify(output).findings == sound else []
    try:
        run(study(), output, workers=1, progress=log).close()
    except SweepError as fault:
        wrong += [] if "give it up with --force" in str(fault) else [f"told: {fault}"]
        run(study(), output, workers=1, progress=log, force=True).close()
    wrong += [] if numbers(output) == whole else ["other numbers"]
    wrong += ["something is left"] if list(scratch.iterdir()) != [output] else []
    output.unlink()
    return kind, "; ".join(wrong)


def damaged_result(rng, result, strange, scratch, whole):
    """Damages a copy of a finished result, and repairs it; what kind, and what went wrong: "" where nothing did."""
    output = scratch / "out.h5"
    shutil.copy(result, output)
    kind, wrong = damage(rng, output, strange), []
    if kind != "missing" and output.read_bytes() != result.read_bytes():
        found = verify(output)
        wrong += ["not found"] if found.whole else []
        if found.blocks is not None:
            run(study(), output, workers=1, progress=False, repair=True).close()
            wrong += [] if numbers(output) == whole and verify(output).whole else ["not repaired"]
    output.unlink(missing_ok=True)
    return kind, "; ".join(wrong)


def flip(rng, path):
    """Flips a bit; returns its place."""
    content = bytearray(path.read_bytes())
    place = rng.randrange(len(content))
    content[place] ^= 1 << rng.randrange(8)
    path.write_bytes(content)
    return place


def main():
    """Forks a run for every line on stdin, kills it after its time, and says how it ended: 0 or 9."""
    quiet = os.open(os.devnull, os.O_WRONLY)
    with tempfile.TemporaryDirectory() as folder:
        # once here, so that all is imported
        # but for a refinement, which leaves threads behind that a fork does not survive
        for kind in KINDS[:-1]:
            output = Path(folder) / f"{kind}.h5"
            prepare(kind, output)
            perform(kind, output, 1, 300)
    for line in sys.stdin:
        kind, output, workers, cells, log, seconds = json.loads(line)
        child = os.fork()
        if child == 0:
            os.dup2(quiet, 2)
            os._exit(_child(kind, Path(output), workers, cells, log))
        print(_ended(child, time.monotonic() + seconds), flush=True)


def _ended(child, deadline):
    """Exit status of a child, or number of the signal that killed it."""
    while True:
        late = time.monotonic() >= deadline
        if late:
            # until it is waited for it is a zombie, so this is no other process
            os.kill(child, signal.SIGKILL)
        found, status = os.waitpid(child, 0 if late else os.WNOHANG)
        if found:
            return os.WTERMSIG(status) if os.WIFSIGNALED(status) else os.waitstatus_to_exitcode(status)
        time.sleep(1e-3)


def _child(kind, output, workers, cells, log):
    """A run; every block is noted when it is acknowledged."""
    real, told = storing.write_digests, os.open(log, os.O_WRONLY | os.O_APPEND)
    storing.SYNC_SECONDS = 0.005

    def noting(fd, table, digests):
        real(fd, table, digests)
        if any(map(any, digests.values())) and _is_work(fd, table, unfinished_of(output)):
            os.write(told, "".join(f"{block}\n" for block in digests).encode())

    storing.write_digests = noting
    try:
        perform(kind, output, workers, cells)
    except BaseException as fault:
        Path(log).with_name("fault").write_text(f"{kind} {type(fault).__name__}: {fault}")
        return 1
    return 0


def _is_work(fd, table, path):
    """Whether a table is of what the run computes into its file, not of what is made from that, or of another file."""
    if not path.exists() or path.stat().st_ino != os.fstat(fd).st_ino:
        return False
    with StoredFile(path) as file:
        return file.layout.work.digests == table.digests


if __name__ == "__main__":
    main()
