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

import h5py
import numpy as np
import xxhash

HERE = Path(__file__)
sys.path[:0] = [p for p in (str(HERE.parent), str(HERE.parents[2])) if p not in sys.path]

from sweep.cells.output_schema import part_columns  # noqa: E402
from sweep.results.open import open_result  # noqa: E402
from sweep.results.verify import verify  # noqa: E402
from sweep.runs import run as runner  # noqa: E402
from sweep.runs.run import run  # noqa: E402
from sweep.store.hdf5_bytes import PartBytes  # noqa: E402
from sweep.store.manifest import MANIFEST  # noqa: E402
from sweep.store.parts import digest, part_name  # noqa: E402
from sweep.store.store import Store, folder_of  # noqa: E402
from sweep.study.read import build_study  # noqa: E402
from sweep.system.errors import SweepError  # noqa: E402

CELLS = 3000


def study(cells=CELLS):
    """A stone thrown from many heights, its way traced."""
    axes = {"height": np.linspace(1.0, 50.0, cells // 3), "v0": [0.0, 1.0, -1.0]}
    return build_study(
        kernel="toy:KERNEL", allow_import=True, axes=axes, outputs=["fall_time", "drop"], along={"phase": [0.0, 0.5]}
    )


def numbers(path):
    """Digest of all that a finished result holds but times and what hangs on the blocks."""
    state = xxhash.xxh3_128()
    with open_result(path, strict=True) as found:
        for name in [*found.data_vars, *found.coords]:
            state.update(name.encode() + np.ascontiguousarray(found[name].values).tobytes())
    return state.hexdigest()


def parts(output):
    """Names of the parts that are there."""
    return {path.name for path in folder_of(output).glob("*-*.h5")}


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

    def run(self, output, workers, cells, seconds):
        """Whether the run came to its end before it was killed, after so many seconds; and what it acknowledged."""
        log = output.with_name("acknowledged")
        log.write_text("")
        self._parent.stdin.write(json.dumps([str(output), workers, cells, str(log), seconds]) + "\n")
        self._parent.stdin.flush()
        ended = self._parent.stdout.readline().strip()
        assert ended in ("0", "9"), ended
        return ended == "0", set(log.read_text().splitlines())


def torture(rng, victims, folder, kills, whole, usual, shapes):
    """Kills runs at random moments, each continued until it ends.

    Returns
    -------
    dict
        "kills", "runs" that came to their end, "acknowledged" blocks of those that were killed, and of these "lost";
        "different": ends with other bits; "stages": what there was when a run was killed.
    """
    found = {"kills": 0, "runs": 0, "acknowledged": 0, "lost": 0, "different": 0, "stages": Counter()}
    while found["kills"] < kills:
        output, cells = folder / f"out{found['runs']}.h5", rng.choice(shapes)
        ended, kept = False, set()
        while not ended:
            seconds = 1.1 * usual * rng.random() ** 2
            ended, acknowledged = victims.run(output, rng.choice([1, 2, 8]), cells, seconds)
            kept |= acknowledged
            # once it is put together, the result is what counts; it has the same digest or not
            lost = set() if output.exists() else kept - parts(output)
            if not ended:
                found["kills"] += 1
                found["acknowledged"] += len(acknowledged)
                found["lost"] += len(lost)
                found["stages"][_stage(output)] += 1
        found["runs"] += 1
        found["different"] += numbers(output) != whole or folder_of(output).exists()
        output.unlink()
    return found


def _stage(output):
    """How far a killed run had come."""
    if output.exists():
        return "put together, parts not removed" if folder_of(output).exists() else "at its very end"
    if not folder_of(output).exists():
        return "nothing there yet"
    names = [path.name for path in folder_of(output).iterdir()]
    if any(name.startswith("result.h5") for name in names):
        return "while it was put together"
    return "block half written" if any(n.endswith(".tmp") for n in names) else "between blocks"


DAMAGES = ("flip", "flip", "flip", "cut", "empty", "missing", "doubled", "foreign", "swapped", "strange",
           "stranger", "spec")  # fmt: skip


def unfinished(output):
    """Stops the study when all is computed and nothing is put together."""
    real = runner.assemble
    runner.assemble = _stop
    try:
        run(study(), output, workers=1, block_cells=300, progress=False)
    except SweepError:
        return folder_of(output)
    finally:
        runner.assemble = real


def _stop(*rest):
    raise SweepError("stopped")


def damage(rng, folder):
    """Damages the parts of a sweep in some way.

    Returns
    -------
    kind, found : str
        What it did, and what `sweep verify` must say of it.
    """
    path, other = rng.sample(sorted(folder.glob("*-*.h5")), 2)
    kind, content = rng.choice(DAMAGES), path.read_bytes()
    if kind == "missing":
        path.unlink()
        return kind, f"missing: cells {int(path.name[:12]):,} to {int(path.name[13:25]):,}"
    if kind == "doubled":
        double = path.with_name(f"{path.name[:25]}.{rng.getrandbits(128):032x}.h5")
        shutil.copy(path, double)
        return kind, f"twice there: {double.name}"
    if kind in ("foreign", "strange"):
        name = "notes.txt" if kind == "foreign" else f"000000000001-000000000002.{'0' * 32}.h5"
        (folder / name).write_bytes(rng.randbytes(3000))
        return kind, f"not of this sweep: {name}"
    if kind == "spec":
        flip(rng, folder / MANIFEST)
        return kind, MANIFEST
    if kind == "stranger":
        return kind, f"damaged: {stranger(path).name}"
    if kind == "flip":
        flip(rng, path)
    elif kind == "swapped":
        path.write_bytes(other.read_bytes())
    else:
        path.write_bytes(content[: rng.randrange(1, len(content)) if kind == "cut" else 0])
    return kind, f"damaged: {path.name}"


def stranger(path):
    """Puts a sound part of another study, of the same cells and columns, in the place of a part."""
    columns, start, stop = part_columns(study()), int(path.name[:12]), int(path.name[13:25])
    with h5py.File(path) as file:
        arrays = {column.name: file[column.name][...] for column in columns}
    arrays["fall_time"] += 1.0
    path.unlink()
    other = path.with_name(part_name(start, stop, digest(columns, arrays, b"another")))
    other.write_bytes(b"".join(map(bytes, PartBytes(columns).pieces(start, stop, arrays))))
    return other


def damaged_parts(rng, folder, scratch, whole):
    """Damages a copy of a folder of parts; what kind, and what went wrong: "" where nothing did."""
    output = scratch / "out.h5"
    shutil.copytree(folder, folder_of(output))
    kind, expected = damage(rng, folder_of(output))
    try:
        told = verify(output).findings
    except SweepError as fault:
        # of a manifest whose white space was hit nothing is said
        told = (MANIFEST,) if f"{MANIFEST}: " in str(fault) else (str(fault),)
    told = (*told, MANIFEST) if kind == "spec" and "put together yet" in told[0] else told
    log = io.StringIO()
    run(study(), output, workers=1, progress=log).close()
    wrong = [] if expected in told else [f"not told: {expected}"]
    wrong += [] if numbers(output) == whole else ["other numbers"]
    if kind == "foreign":
        (folder_of(output) / "notes.txt").unlink()
        (folder_of(output) / "lock").unlink(missing_ok=True)
        folder_of(output).rmdir()
    wrong += ["something is left"] if list(scratch.iterdir()) != [output] else []
    output.unlink()
    return kind, "; ".join(wrong)


def damaged_result(rng, result, scratch):
    """Damages a copy of a finished result; what kind, and what went wrong: "" where nothing did."""
    output, kind = scratch / "out.h5", rng.choice(["flip"] * 24 + ["zeroed"] * 24 + ["cut", "longer"])
    shutil.copy(result, output)
    content = bytearray(output.read_bytes())
    if kind == "flip":
        flip(rng, output)
    elif kind == "zeroed":
        place = rng.randrange(len(content))
        content[place : place + 512] = bytes(len(content[place : place + 512]))
        output.write_bytes(content)
    else:
        output.write_bytes(content + rng.randbytes(100) if kind == "longer" else content[: rng.randrange(len(content))])
    same = output.read_bytes() == result.read_bytes()
    found = verify(output).whole == same
    output.unlink()
    return kind, "" if found else "not found"


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
        run(study(), Path(folder) / "out.h5", workers=1, progress=False).close()
    for line in sys.stdin:
        output, workers, cells, log, seconds = json.loads(line)
        child = os.fork()
        if child == 0:
            os.dup2(quiet, 2)
            os._exit(_child(output, workers, cells, log))
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


def _child(output, workers, cells, log):
    """Runs the study; every part is noted when it is acknowledged."""
    real, told = Store.put, os.open(log, os.O_WRONLY | os.O_APPEND)

    def put(self, index, arrays):
        real(self, index, arrays)
        os.write(told, (self.names[index] + "\n").encode())

    Store.put = put
    try:
        run(study(), output, workers=workers, block_cells=cells, progress=False).close()
    except BaseException:
        return 1
    return 0


if __name__ == "__main__":
    main()
