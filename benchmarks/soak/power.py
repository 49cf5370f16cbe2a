"""Some sixty wrong behaviours, each a small patch of its own: which of them do the tests catch?

    python benchmarks/soak/power.py [--room kernels/foliot ...] [--only NAME ...] [--plain] [--limit 600]
    python benchmarks/soak/power.py --check

They stand in wrong_behaviours.toml, with what the tests of an earlier commit have caught. Each is applied in a copy of
the checkout, and only tests that reach the line are run, up to the first that fails: the files, or tests of files, that
are listed with it, then the files of its room, then those of its whole package. Those of kernels run as plain Python
first. A test that fails without the patch as well counts for nothing. Exit status 1 where more than two that were
caught are missed now.
"""

import argparse
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
LIST = Path(__file__).with_name("wrong_behaviours.toml")
MOST_LOST = 2
"""How many may be missed that the earlier tests caught."""
FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+?\.py(?:::.*?)?)(?: - .*)?$", re.MULTILINE)


def main():
    arguments = read_arguments()
    behaviours = chosen(tomllib.loads(LIST.read_text(encoding="utf-8"))["behaviour"], arguments)
    misfits = [text for behaviour in behaviours for text in misfit(arguments.checkout, behaviour)]
    print("\n".join(misfits or [f"{len(behaviours)} patches fit"]), flush=True)
    if misfits or arguments.check:
        return int(bool(misfits))
    with tempfile.TemporaryDirectory() as folder:
        trial = Trial(arguments.checkout, Path(folder), arguments)
        found = {behaviour["name"]: trial.outcome(behaviour) for behaviour in behaviours}
    lost = [b["name"] for b in behaviours if b["before"] == "caught" and found[b["name"]] == "missed"]
    won = [b["name"] for b in behaviours if b["before"] == "missed" and found[b["name"]] == "caught"]
    print(f"{sum(outcome == 'caught' for outcome in found.values())} of {len(found)} caught")
    print(f"caught before, missed now: {', '.join(lost) or 'none'}")
    print(f"missed before, caught now: {', '.join(won) or 'none'}")
    return int(len(lost) > MOST_LOST)


def read_arguments():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--check", action="store_true", help="only whether each patch fits today's sources")
    parser.add_argument("--only", nargs="*", metavar="NAME", help="these behaviours")
    parser.add_argument("--room", nargs="*", metavar="ROOM", help="those of these rooms, e.g. sweep/file")
    parser.add_argument("--plain", action="store_true", help="run kernels as plain Python alone, and compile nothing")
    parser.add_argument("--limit", type=float, default=600.0, help="seconds for a file of tests")
    parser.add_argument("--checkout", type=Path, default=ROOT, help="what is tried; default: this checkout")
    return parser.parse_args()


def chosen(behaviours, arguments):
    """Those that are asked for, by name and by room; all by default."""
    for asked, key in ((arguments.only, "name"), (arguments.room, "room")):
        strange = set(asked or ()) - {behaviour[key] for behaviour in behaviours}
        if strange:
            raise SystemExit(f"no behaviour has the {key} {', '.join(sorted(strange))}")
        behaviours = [behaviour for behaviour in behaviours if not asked or behaviour[key] in asked]
    return behaviours


def misfit(checkout, behaviour):
    """Why a patch does not fit the sources, a line each; none where it does."""
    name, path = behaviour["name"], checkout / behaviour["file"]
    count = path.read_text(encoding="utf-8").count(behaviour["old"]) if path.is_file() else 0
    if count != 1:
        yield f"{name}: the old text occurs {count} times in {behaviour['file']}"


class Trial:
    """A copy of a checkout in which one behaviour at a time is wrong."""

    def __init__(self, checkout, folder, arguments):
        self.copy, self.plain, self.limit = folder / "checkout", arguments.plain, arguments.limit
        self.cache = folder / "cache"
        names = subprocess.run(["git", "ls-files", "-z"], cwd=checkout, check=True, capture_output=True, text=True)
        for name in filter(None, names.stdout.split("\0")):
            if (checkout / name).is_file():
                (self.copy / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(checkout / name, self.copy / name)
        self.unsound, self.compiles = [], False

    def outcome(self, behaviour):
        """Prints and returns "caught" or "missed"."""
        begun, path = time.monotonic(), self.copy / behaviour["file"]
        self.compiles = behaviour["file"].startswith("kernels/")
        sound = path.read_text(encoding="utf-8")
        wrong = sound.replace(behaviour["old"], behaviour["new"])
        late = []
        for file in self.files(behaviour):
            for plain in self.ways():
                test = self.caught_by(path, sound, wrong, file, plain, late)
                if test:
                    self.say("caught", behaviour, begun, test)
                    return "caught"
        self.say("missed", behaviour, begun, f"longer than {self.limit:g} s: {', '.join(late)}" if late else "")
        return "missed"

    def files(self, behaviour):
        """Files of tests, the most probable first."""
        tests, module = self.copy / "tests", Path(behaviour["file"]).stem.strip("_")
        room = sorted((tests / behaviour["room"]).glob("test_*.py"), key=lambda path: (module not in path.stem, path))
        package = sorted((tests / behaviour["room"].partition("/")[0]).glob("test_*.py"))
        own = [str(path.relative_to(self.copy)) for path in (*room, *package)]
        here = lambda name: (self.copy / name.partition("::")[0]).is_file()  # noqa: E731  others were of earlier tests
        listed = list(filter(here, behaviour["tests"]))
        return list(dict.fromkeys([*listed, *own]))

    def ways(self):
        """Whether kernels are plain Python, compiled, or both in turn."""
        return [False] if not self.compiles else [True] if self.plain else [True, False]

    def caught_by(self, path, sound, wrong, file, plain, late):
        """The first test of a file that fails with the patch alone; None where there is none."""
        while True:
            path.write_text(wrong, encoding="utf-8")
            try:
                test = self.first_failure(file, plain)
            except subprocess.TimeoutExpired:
                late.append(file)
                return None
            finally:
                path.write_text(sound, encoding="utf-8")
            if test is None or self.is_sound(test, plain):
                return test
            self.unsound.append(test)

    def is_sound(self, test, plain):
        try:
            return self.first_failure(test, plain) is None
        except subprocess.TimeoutExpired:
            return False

    def first_failure(self, tests, plain):
        """The test that fails first, or the file that cannot be read. Raises TimeoutExpired."""
        if tests in self.unsound:  # a whole file, which cannot be read
            return None
        leave_out = [f"--deselect={test}" for test in self.unsound]
        command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *leave_out, tests]
        environment = {**os.environ, "PYTHONPATH": str(self.copy), "NUMBA_DISABLE_JIT": "1" if plain else "0"}
        if self.compiles:  # machine code of wrong kernels is not left to others
            environment["XDG_CACHE_HOME"] = str(self.cache)
        with subprocess.Popen(
            command, cwd=self.copy, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            start_new_session=True,
        ) as process:  # fmt: skip
            try:
                output, _ = process.communicate(timeout=self.limit)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                raise
        found = FAILED.search(output)
        if found is None and process.returncode not in (0, 5):  # 5: nothing to run
            return tests  # the whole process died
        return found[1] if found else None

    def say(self, outcome, behaviour, begun, more):
        seconds = f"{time.monotonic() - begun:.0f} s"
        print(f"{outcome:6} {behaviour['name']:32} {seconds:>6}  before: {behaviour['before']:9}  {more}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
