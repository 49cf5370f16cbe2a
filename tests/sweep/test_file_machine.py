"""A result as a state machine: whatever happens to it, nothing acknowledged is lost and no number is wrong.

How far a run comes hangs on the machine's load, so that which rules there are hangs on nothing: one that does not
apply does nothing.

A run begins, continues, extends, repairs; it is interrupted, its disk refuses a call, it is killed, the power is cut;
files are damaged. Between all that the file is read and verified, and compared with what its cells are.
"""

import errno
import os
import random
import shutil
import signal
import stat
import tempfile
import threading
from functools import cache
from pathlib import Path

import dice
import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    rule,
    run_state_machine_as_test,
)
from study_interpreter import interpreted

import sweep
from kernels.interface import Status
from sweep.file import disk

CALLS = ("open_file", "write", "reserve", "fsync", "sync_numbers", "rename", "remove")
FAULTS = {"open_file": errno.EMFILE, "write": errno.ENOSPC, "reserve": errno.ENOSPC}
XS, YS = [float(x) for x in range(1, 25) if x != dice.RAISES], [1.0, 2.0]
SECTOR = 512


def keys_of(xs, summary):
    keys = {"kernel": "dice:KERNEL", "outputs": ["a", "c"], "along": {"phase": [0.0, 0.5, 1.0]}, "rtol": 1e-6}
    keys |= {"axes": {"x": list(xs), "y": YS}}
    reductions = {"over": ["x"], "outputs": {"a": ["min", "mean", "argmax"], "c": ["max"]}}
    return keys | ({"summary": reductions} if summary else {})


class Disk:
    """The disk of a run, which at the call of a name and number fails once, or for good: the power is cut.

    What was written since the last sync is then there or not, piece by piece; or all is, where only the process died.
    """

    def __init__(self, folder, name, turn, fatal, loses, rng, look):
        self.folder, self.name, self.left, self.rng, self.look = folder, name, turn, rng, look
        self.fatal, self.loses = fatal, loses
        self.dead, self.lock, self.looking = False, threading.RLock(), False
        self.safe, self.pending, self.renamed, self.promised = {}, {}, [], None
        self.real = {call: getattr(disk, call) for call in CALLS}

    def __enter__(self):
        for call in CALLS:
            setattr(disk, call, lambda *words, call=call: self.called(call, *words))
        return self

    def __exit__(self, *fault):
        for call, real in self.real.items():
            setattr(disk, call, real)
        if self.loses:
            self.lose()

    def called(self, call, *words):
        with self.lock:
            if self.looking:
                return self.real[call](*words)
            self.left -= call == self.name
            if self.dead or (call == self.name and self.left == 0):
                self.dead = self.fatal
                raise OSError(FAULTS.get(call, errno.EIO), "refused by the test")
            return getattr(self, f"on_{call}", self.real[call])(*words)

    def on_write(self, fd, pieces, offset):
        number = os.fstat(fd).st_ino
        if number not in self.safe:  # what an earlier run has left is on the disk
            self.safe[number] = os.pread(fd, os.fstat(fd).st_size, 0)
        taken = [pieces[0][:97]] if self.rng.random() < 0.3 else pieces  # a disk may take a part only
        count = self.real["write"](fd, taken, offset)
        self.pending.setdefault(number, []).append((offset, b"".join(pieces)[:count]))
        return count

    def on_fsync(self, fd):
        self.synced("fsync", fd)

    def on_sync_numbers(self, fd):
        self.synced("sync_numbers", fd)

    def synced(self, call, fd):
        there = None
        if self.fatal and not stat.S_ISDIR(os.fstat(fd).st_mode):
            self.looking = True
            there = self.look()
            self.looking = False
        self.real[call](fd)
        if stat.S_ISDIR(os.fstat(fd).st_mode):
            self.renamed.clear()
        else:
            self.safe[os.fstat(fd).st_ino] = os.pread(fd, os.fstat(fd).st_size, 0)
            self.pending.pop(os.fstat(fd).st_ino, None)
        self.promised = there if there is not None else self.promised

    def on_rename(self, old, new):
        before = new.read_bytes() if new.exists() else None
        self.real["rename"](old, new)
        self.renamed.append((old, new, before))

    def lose(self):
        """What is left after a power cut."""
        for old, new, before in reversed(self.renamed):
            if self.rng.random() < 0.5 and new.exists():
                new.rename(old)
                if before is not None:
                    new.write_bytes(before)
            else:
                break
        for path in self.folder.iterdir():
            number = path.stat().st_ino
            if number in self.pending:
                content = bytearray(self.safe[number].ljust(path.stat().st_size, b"\0"))
                for offset, data in self.pending[number]:
                    for at in range(0, len(data), SECTOR):
                        if self.rng.random() < 0.5:
                            piece = data[at : at + SECTOR]
                            content[offset + at : offset + at + len(piece)] = piece
                path.write_bytes(content)


class File(RuleBasedStateMachine):
    """The result of a study, and what is known of it."""

    def __init__(self):
        super().__init__()
        self.folder = Path(tempfile.mkdtemp())
        self.output = self.folder / "out.h5"
        self.unfinished = self.folder / "out.h5.unfinished"
        self.xs, self.old, self.kept, self.hurt = [], None, frozenset(), False

    def teardown(self):
        if self.xs and not self.hurt:
            self.ends()
        shutil.rmtree(self.folder)

    @initialize(summary=st.booleans(), seed=st.integers(0, 1000))
    def begin(self, summary, seed):
        self.summary, self.rng = summary, random.Random(seed)
        self.target = self.rng.sample(XS, self.rng.randint(4, 9))
        self.target.sort()

    # what happens

    def run(self, **options):
        """Runs the study; whether it came to its end."""
        self.xs = self.target
        keys = keys_of(self.xs, self.summary)
        options = {"workers": 1, "progress": False, "allow_import": True, "extend": self.old is not None, **options}
        try:
            sweep.run(keys, self.output, **options).close()
        except (sweep.SweepError, KeyboardInterrupt):
            return False
        return True

    @rule(last=st.integers(1, 12), size=st.sampled_from([1, 2, 3, 5]), workers=st.integers(1, 2), cut=st.booleans())
    def interrupted(self, last, size, workers, cut):
        """Ctrl-C, and a power cut after that, or not."""
        if self.hurt:
            return self.mend(size)
        calls = [0]

        def count(x):
            calls[0] += 1
            if calls[0] == last:
                os.kill(os.getpid(), signal.SIGINT)

        dice.before_check = count
        try:
            with Disk(self.folder, "", 1, False, cut, self.rng, None):
                self.run(block_cells=size, workers=workers)
                dice.before_check = None  # what is done is compared with truths that the same kernel computes
                self.kept = self.done()
        finally:
            dice.before_check = None

    @rule(name=st.sampled_from(CALLS), turn=st.integers(1, 25), size=st.sampled_from([1, 2, 3, 5]),
          kind=st.sampled_from(["fault", "killed", "power cut"]))  # fmt: skip
    def refused(self, name, turn, size, kind):
        if self.hurt:
            return self.mend(size)
        fatal = kind != "fault"
        with Disk(self.folder, name, turn, fatal, kind == "power cut", self.rng, self.done) as there:
            ended = self.run(block_cells=size)
        self.kept |= there.promised if there.dead and there.promised else frozenset()
        assert not ended or sweep.verify(self.output).whole

    @rule()
    def ends(self):
        if self.xs and not self.hurt:
            assert self.run()
            self.finished()

    @rule(seed=st.integers(0, 1000))
    def extend(self, seed):
        if self.hurt or self.summary or self.old is not None or not self.xs:
            return
        self.ends()
        more = [x for x in XS if x not in self.xs]
        self.old = self.xs
        self.target = sorted([*self.xs, *random.Random(seed).sample(more, 3)])
        self.kept = frozenset()

    @rule(seed=st.integers(0, 10**6), kind=st.sampled_from(["bit", "bit", "bit", "zeros", "cut", "more"]))
    def damage(self, seed, kind):
        rng = random.Random(seed)
        there = [p for p in (self.output, self.unfinished) if p.exists()]
        if self.hurt or not there:
            return
        path = rng.choice(there)
        content = bytearray(path.read_bytes())
        at = rng.randrange(len(content))
        if kind == "bit":
            content[at] ^= 1 << rng.randrange(8)
        elif kind == "zeros":
            content[at : at + SECTOR] = bytes(len(content[at : at + SECTOR]))
        else:
            content = content[:at] if kind == "cut" else content + b"more"
        if content != path.read_bytes():
            path.write_bytes(content)
            self.hurt = True
            if path == self.output:
                assert not sweep.verify(path).whole
            else:
                sweep.verify(path)

    @rule(size=st.sampled_from([None, 1, 3]))
    def mend(self, size):
        """What is damaged is computed again, or told to be lost and given up."""
        if not self.hurt:
            return
        finished = self.output.exists() and not self.unfinished.exists() and self.xs == (self.old or self.xs)
        if finished and not sweep.verify(self.output).whole:
            assert not self.run(extend=False)
            if sweep.verify(self.output).blocks is not None:
                assert self.run(repair=True, extend=False)
        if not self.run(block_cells=size) and not self.run(force=True, extend=False, block_cells=size):
            # what is no result any more might be somebody else's, and is not even overwritten by force
            with pytest.raises(sweep.SweepError):
                sweep.open_result(self.output)
            self.output.unlink()
            assert self.run(extend=False, block_cells=size)
        self.hurt, self.old = False, None
        self.finished()

    # what is there

    def finished(self):
        """The result is whole, and nothing is beside it."""
        assert sweep.verify(self.output).whole
        assert [path.name for path in self.folder.iterdir()] == ["out.h5"]
        self.old, self.kept = None, self.done()
        assert len(self.kept) == len(self.xs) * len(YS)

    @invariant()
    def nothing_is_lost_and_no_number_is_wrong(self):
        if self.unfinished.exists() and self.output.exists():
            self.read(self.output)
        done = self.done()
        assert self.hurt or done >= self.kept
        self.kept = done

    def done(self):
        """What is computed and right, of the run that goes on."""
        path = self.unfinished if self.unfinished.exists() else self.output
        return self.read(path) if path.exists() else frozenset()

    def read(self, path):
        """The cells that have numbers, which are right; what is damaged is told. Of a summary, how many they are."""
        try:
            with sweep.open_result(path) as found:
                if self.summary:
                    return self.read_summary(found)
                wanted, done = truth(tuple(found.x.values), False), (found.status != Status.PENDING).values
                for name in ("a", "c", "status", "method_used"):
                    nothing = {"status": int(Status.PENDING), "method_used": -1}.get(name, np.nan)
                    held = done[..., None] if name == "c" else done
                    self.equal(found, name, np.where(held, wanted[name][1], nothing))
                x, y = np.meshgrid(found.x, found.y, indexing="ij")
                there = frozenset(zip(x[done].tolist(), y[done].tolist(), strict=True))
                return frozenset() if self.old and path == self.output and len(found.x) == len(self.old) else there
        except sweep.SweepError:
            assert self.hurt
            return frozenset()

    def read_summary(self, found):
        wanted, counts = truth(tuple(self.xs), True), found.cells_by_status.values
        pending = list(found.status_name.values).index("PENDING")
        if not counts[:, pending].any():
            for name in ("a_min", "a_mean", "c_max", "a_count", "cells_by_status", "a_argmax_x", "cells_by_method"):
                self.equal(found, name, wanted[name][1])
        left = counts[:, pending].sum()
        assert (np.delete(counts, pending, axis=1) <= np.delete(wanted["cells_by_status"][1], pending, axis=1)).all()
        return frozenset(range(counts.sum() - left))

    def equal(self, found, name, wanted):
        try:
            np.testing.assert_array_equal(found[name].values, wanted, err_msg=name)
        except sweep.SweepError:
            assert self.hurt


@cache
def truth(xs, summary):
    return interpreted(dice.KERNEL, keys_of(xs, summary))


def test_whatever_happens_nothing_acknowledged_is_lost_and_no_number_is_wrong():
    """A few files here; more of them by night: EXAMPLES=500 python -m pytest tests/sweep/test_file_machine.py"""
    examples = int(os.environ.get("EXAMPLES", "8"))
    how = settings(max_examples=examples, stateful_step_count=8, derandomize=True, deadline=None, database=None,
                   phases=[Phase.generate], suppress_health_check=list(HealthCheck))  # fmt: skip
    run_state_machine_as_test(File, settings=how)


@pytest.mark.parametrize("name", CALLS)
def test_whichever_call_of_the_disk_fails_the_result_is_continued(name):
    for turn in (1, 2, 3, 4, 6, 9, 14, 22):
        file = File()
        file.begin(turn % 3 == 0, turn)
        file.refused(name, turn, 3, "power cut" if turn % 2 else "fault")
        ended = file.output.exists() and not file.unfinished.exists()
        file.nothing_is_lost_and_no_number_is_wrong()
        file.teardown()
        if ended:
            break
    assert turn > 1
