"""Runs that are killed at moments that are aimed at; shared by tests and the soak script.

A process that has imported everything forks a run for every kill. The run notes in shared memory which phase it is in;
after the death of the run, that tells which one was hit.
"""

from __future__ import annotations

import json
import mmap
import os
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np
from havoc import numbers, study

import sweep
from sweep.file import disk
from sweep.file.open import open_result, verify
from sweep.file.reading import StoredFile
from sweep.file.store import Store, lock_of, unfinished_of
from sweep.runs.run import run

KINDS = ("plain", "extend", "summary", "refine")
PATIENCE = 900.0
"""Seconds that a run may take that is not killed, on a machine that does much else."""
BEFORE, WORK, END, RENAME, AFTER, BETWEEN = range(6)
PHASES = ("before its frame", "at work", "at its end", "while renamed", "after that", "between rounds")
AIMS = (BEFORE, *(WORK,) * 5, END, *(RENAME,) * 2, AFTER)
"""Phases that are aimed at, as often as they stand here."""
COUNT, EVENT = struct.Struct("q"), struct.Struct("qd")
TRIES = 8
"""Most kills of a run before it is left alone."""


def few():
    """What is refined."""
    return study(90, speeds=(0.0, 1.0, 4.0), outputs=["fall_time"], along={})


def base_of(output):
    """The finished result that a run of its kind begins with."""
    return output.with_name("base.h5")


def perform(kind, output, workers, cells, cluster=None):
    """A run of some kind to its end."""
    keys = {"workers": workers, "progress": False, "block_cells": cells}
    if kind == "refine" and output.exists():  # killed at its very end; a second call would be told that it is there
        shutil.rmtree(output.with_name(f"{output.name}.rounds"), ignore_errors=True)
        lock_of(output).unlink(missing_ok=True)
    elif kind == "refine":
        with open_result(base_of(output)) as found:
            sweep.refine(found, "fall_time", 1e-2, path=output, study=few(), workers=workers)
    elif kind == "summary":
        over = {"over": ["height"], "outputs": {"fall_time": ["min", "mean", "argmax"], "drop": ["mean"]}}
        run(study(summary=over), output, **keys).close()
    elif kind == "cluster":
        run(study(), output, **{**keys, "workers": None, "cluster": cluster}).close()
    else:
        run(study(), output, extend=kind == "extend", **keys).close()


def prepare(kind, output):
    """Makes what a run of some kind begins with."""
    if kind == "extend":
        half = output.with_name("half")
        if not half.exists():
            run(study(every=2), output, workers=1, progress=False).close()
            output.rename(half)
        shutil.copy(half, output)
    if kind == "refine" and not base_of(output).exists():
        run(few(), base_of(output), workers=1, progress=False).close()


def done(path):
    """Blocks of an unfinished result that are acknowledged, and how many there are."""
    with StoredFile(path) as file:
        found = file.work.done
        return set(np.flatnonzero(found).tolist()), len(found)


class Victims:
    """Runs in processes that are killed. To be used in a `with`.

    Parameters
    ----------
    cluster : str, optional
        Address of the scheduler of runs of the kind "cluster".
    """

    def __init__(self, cluster=None):
        self._cluster = cluster

    def __enter__(self):
        words = [sys.executable, __file__, *([self._cluster] if self._cluster else [])]
        # the threads of a library would not survive a fork
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
        self._parent = subprocess.Popen(
            words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
        )
        return self

    def __exit__(self, *fault):
        self._parent.stdin.close()
        self._parent.wait()
        self._parent.stdout.close()

    def run(self, kind, output, workers, cells, aim=None):
        """A run that is killed.

        Parameters
        ----------
        aim : (phase, n, seconds), optional
            It is killed so many seconds after it has come to a phase for the n-th time.

        Returns
        -------
        bool, list of (phase, seconds), dict of str to list
            Whether it came to its end; when it came to each phase, since it began; what it acknowledged of every file.
        """
        log = output.with_name("acknowledged")
        log.write_text("")
        self._parent.stdin.write(json.dumps([kind, str(output), workers, cells, str(log), aim]) + "\n")
        self._parent.stdin.flush()
        ended, events = json.loads(self._parent.stdout.readline())
        assert ended in (0, signal.SIGKILL), log.with_name("fault").read_text()
        return ended == 0, events, list(map(json.loads, log.read_text().splitlines()))


class Torture:
    """Kills runs, each continued until it ends, and counts what is lost.

    Attributes
    ----------
    hits : Counter of (kind, phase)
    kills, runs, acknowledged, lost, different : int
        Kills; runs that came to their end; blocks acknowledged by killed runs; of these lost; ends with other bits, or
        with something left behind.
    """

    def __init__(self, rng, victims, folder, shapes):
        self._rng, self._victims, self._folder, self._shapes = rng, victims, folder, shapes
        self.hits = Counter()
        self.runs = self.acknowledged = self.lost = self.different = 0
        self._whole, self._usual = {}, {}

    @property
    def kills(self):
        """So far."""
        return self.hits.total()

    def kill(self, kind, kills):
        """Runs of a kind, to their ends, until so many more kills have struck."""
        least = self.kills + kills
        while self.kills < least:
            # a refinement cuts its rounds itself
            cells = self._shapes[-1] if kind == "refine" else self._rng.choice(self._shapes)
            whole = self._measured(kind, cells)
            output = self._folder / f"out{self.runs}.h5"
            self._torture(kind, output, cells)
            left = sorted(path.name for path in self._folder.iterdir() if path.name.startswith(output.name))
            same = numbers(output) == whole and left == [output.name] and verify(output).whole
            if not same:
                print(f"  {kind}, {cells} cells a block: left {left}; {verify(output)}", flush=True)
            self.different += not same
            self.runs += 1
            output.unlink()

    def _measured(self, kind, cells):
        """Digest of what a run that is not killed ends with; when it comes to its phases is noted."""
        if (kind, cells) not in self._usual:
            output = self._folder / f"{kind}{cells}.h5"
            for _ in range(1 if kind in self._whole else 2):  # the first one of all may wait for its parent
                prepare(kind, output)
                ended, self._usual[kind, cells], _ = self._victims.run(kind, output, 2, cells)
                assert ended
                self._whole.setdefault(kind, numbers(output))
                assert self._whole[kind] == numbers(output)
                output.unlink()
        return self._whole[kind]

    def _torture(self, kind, output, cells):
        """One run, killed again and again until it ends."""
        prepare(kind, output)
        kept, tries = {}, 0
        while True:
            aim = self._aim(kind, output, cells) if tries < TRIES else None
            ended, events, log = self._victims.run(kind, output, self._rng.choice([1, 2, 8]), cells, aim)
            if ended:
                return
            tries += 1
            self.hits[kind, events[-1][0]] += 1
            for path, blocks in log:
                kept.setdefault(path, set()).update(blocks)
                self.acknowledged += len(blocks)
            # what is not there any more is in its place, and has the right digest or not
            self.lost += sum(len(blocks - done(path)[0]) for path, blocks in kept.items() if Path(path).exists())

    def _aim(self, kind, output, cells):
        """A phase, and a moment in it, as long as it usually takes; shorter where blocks are there already."""
        usual = self._usual[kind, cells]
        phase = self._rng.choice(AIMS)
        events = [k for k, (found, _) in enumerate(usual[:-1]) if found == phase]
        if not events:
            return AFTER, 1, 0.0
        number = self._rng.randrange(len(events))
        seconds = usual[events[number] + 1][1] - usual[events[number]][1]
        if phase == WORK and unfinished_of(output).exists():
            there, count = done(unfinished_of(output))
            seconds *= 1 - len(there) / count
        return phase, number + 1, self._rng.random() * seconds


class Events:
    """Phases that a forked run has come to, in memory that it shares with its parent."""

    def __init__(self):
        self._memory = mmap.mmap(-1, 1 << 16)

    def clear(self):
        """Before the next run."""
        COUNT.pack_into(self._memory, 0, 0)

    def note(self, phase):
        """The run has come to a phase."""
        (count,) = COUNT.unpack_from(self._memory)
        EVENT.pack_into(self._memory, COUNT.size + count * EVENT.size, phase, time.monotonic())
        COUNT.pack_into(self._memory, 0, count + 1)

    def found(self, first=0):
        """What was noted, from one on."""
        (count,) = COUNT.unpack_from(self._memory)
        return [EVENT.unpack_from(self._memory, COUNT.size + k * EVENT.size) for k in range(first, count)]


def main():
    """Forks a run for every line on stdin, kills it where that is aimed at, and says how it ended: 0 or 9."""
    events, cluster = Events(), sys.argv[1] if len(sys.argv) > 1 else None
    _import_all()
    for line in sys.stdin:
        *words, log, aim = json.loads(line)
        events.clear()
        events.note(BEFORE)
        child = os.fork()
        if child == 0:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
            os._exit(_child(events, Path(log), *words, cluster))
        code = _ended(child, events, aim)
        print(json.dumps([code, events.found()]), flush=True)


def _import_all():
    """Here once, so that runs need not."""
    with tempfile.TemporaryDirectory() as folder:
        for kind in KINDS:
            output = Path(folder) / f"{kind}.h5"
            prepare(kind, output)
            perform(kind, output, 1, 300)


def _ended(child, events, aim):
    """Exit status of a child, or number of the signal that killed it."""
    deadline = time.monotonic() + PATIENCE
    seen = count = 0
    while True:
        found, status = os.waitpid(child, os.WNOHANG)
        if found:
            return os.WTERMSIG(status) if os.WIFSIGNALED(status) else os.waitstatus_to_exitcode(status)
        for phase, at in events.found(seen):
            seen += 1
            count += aim is not None and phase == aim[0]
            if aim is not None and phase == aim[0] and count == aim[1]:
                deadline = at + aim[2]
        if time.monotonic() >= deadline:
            # until it is waited for it is a zombie, so this is no other process
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return int(signal.SIGKILL)
        time.sleep(5e-5)


def _child(events, log, kind, output, workers, cells, cluster):
    """A run that notes its phases, and every block when it is acknowledged."""
    from sweep.file import store as storing

    storing.SYNC_SECONDS = 0.005
    _note_phases(events, Path(output))
    _note_acknowledged(os.open(log, os.O_WRONLY | os.O_APPEND))
    try:
        perform(kind, Path(output), workers, cells, cluster)
    except BaseException as fault:
        log.with_name("fault").write_text(f"{kind} {type(fault).__name__}: {fault}")
        return 1
    return 0


def _note_phases(events, output):
    make, finish, rename, sync = Store.__init__, Store.finish, disk.rename, disk.sync_folder

    def at_work(self, *words):
        make(self, *words)
        events.note(WORK)

    def at_its_end(self, *words):
        events.note(END)
        return finish(self, *words)

    def renamed(old, new):
        if old == unfinished_of(new):
            events.note(RENAME)
        rename(old, new)

    def synced(folder):
        sync(folder)
        if events.found()[-1][0] == RENAME:
            events.note(AFTER if folder == output.parent else BETWEEN)

    Store.__init__, Store.finish, disk.rename, disk.sync_folder = at_work, at_its_end, renamed, synced


def _note_acknowledged(told):
    real = Store._commit

    def noting(self):
        blocks = [index for index, _ in list(self._waiting)]
        real(self)
        if blocks:
            os.write(told, f"{json.dumps([str(self.path), blocks])}\n".encode())

    Store._commit = noting


if __name__ == "__main__":
    main()
