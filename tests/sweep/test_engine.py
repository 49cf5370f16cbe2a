"""The engine against a naive interpreter of studies, over random studies, however they are cut, stopped and continued.

Studies are drawn from numbers that are fixed, so that every run of the tests sees the same ones; more of them by night:
STUDIES=2000 python -m pytest tests/sweep/test_engine.py
"""

import contextlib
import os
import random
import signal
import time
from datetime import datetime, timedelta

import beads
import dice
import numpy as np
import pytest
from clusters import served
from running import same
from study_interpreter import interpreted

import sweep
from kernels.interface import Status

STUDIES = int(os.environ.get("STUDIES", "72"))
KERNELS = {"dice:KERNEL": dice.KERNEL, "beads:KERNEL": beads.KERNEL}
VALUES = {
    "x": [0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 21.0, 34.0, dice.RAISES, -1.0, float("nan")],
    "y": [1.0, 2.0, 0.25, -0.0, 7.0],
    "z": [1.0, 2.0, 0.25, 9.0],
    "kind": ["plain", "odd"],
    "rtol": [1e-12, 1e-9, 1e-6, 1e-4, 0.01],
    "g": [9.8, 1.6, -1.0, 3.7],
    "mass": [[1.0, 2.0, 3.0], [0.1, 0.2, 0.3], [1.0, -1.0, 1.0], [5.0, 4.0, 3.0]],
    "place": [[0.0, 0.5, 1.0], [1.0, 1.0, float("nan")], [2.0, 0.0, 2.0], [0.5, 0.5, 0.5]],
}
CONDITIONS = (
    "x < 4", "x*y >= 2*z**2 and y != 0.25 * z", "not (x + y > 3) or z == 1", "kind == 'odd' or 1 < x <= 8",
    "-y < z**2 / x",
)  # fmt: skip
REDUCTIONS = ("min", "max", "mean", "argmin", "argmax", "histogram")


def some(rng, things, least=1):
    chosen = rng.sample(things, rng.randint(least, len(things)))
    return [thing for thing in things if thing in chosen]


def drawn(seed, *, summary=False, design=None):
    """Keys of a study."""
    rng = random.Random(seed)
    if design is None and not summary and rng.random() < 0.15:
        return of_beads(rng)
    keys = {"kernel": "dice:KERNEL", "outputs": some(rng, ["a", "b", "c"]), "rtol": rng.choice(VALUES["rtol"])}
    design = design or rng.choice(["product"] * 4 + ["zip", "blocks"])
    names = rng.sample(["x", "y", "z", "kind"], rng.randint(1 if design == "product" else 2, 4))
    names += ["rtol"] * (rng.random() < 0.2) + ["method"] * (rng.random() < 0.2 or "x" not in names)
    keys["fixed"] = {} if "x" in names else {"x": rng.choice(VALUES["x"][:8])}
    for name in ("y", "z", "kind"):
        if name not in names and rng.random() < 0.2:
            keys["fixed"][name] = rng.choice(VALUES[name])
    if rng.random() < 0.3:
        keys["where"] = rng.choice(CONDITIONS)
    methods = possible(keys, names)
    keys["method"] = rng.choice([*methods, *["auto"] * 6])
    pools = {**VALUES, "method": ["auto", *methods]}
    rng.shuffle(names)
    length = rng.randint(2, 7)
    axes = {name: rng.sample(pools[name], rng.randint(1, min(len(pools[name]), 6))) for name in names}
    if design != "product":
        zipped = names if design == "zip" else names[: max(1, len(names) // 2)]
        axes |= {name: rng.choices(pools[name], k=length) for name in zipped}
    if "x" in axes and not set(axes["x"]) & set(VALUES["x"][:8]):
        axes["x"][0] = 2.0  # a kernel that fails in every cell is given up
    keys = {name: value for name, value in keys.items() if name not in axes} | {"axes": axes, "design": design}
    if design == "blocks":
        rest = names[len(zipped) :]
        keys["blocks"] = [{"design": "zip", "axes": {n: axes[n] for n in zipped}}]
        keys["blocks"] += [{"axes": {n: axes[n] for n in rest}}] if rest else []
        rng.shuffle(keys["blocks"])
        del keys["axes"], keys["design"]
    if "c" in keys["outputs"]:
        keys["along"] = {"phase": [0.0, 0.25, 1.0][: rng.randint(1, 3)]}
    if summary:
        together = [list(b["axes"]) for b in keys.get("blocks", [keys]) if b.get("design", "product") != "product"]
        keys["summary"] = reductions(rng, keys["outputs"], list(axes), together)
    return keys


def possible(keys, names):
    """Methods that can be named: they can do every term, and give every output that is asked for."""
    set_ = {*names, *(n for n, value in keys["fixed"].items() if value not in (1.0, "plain"))}
    set_ |= {"z"} if {"y", "z"} & (set_ | set(keys["fixed"])) else set()
    outputs = set(keys["outputs"])
    return [m.name for m in dice.KERNEL.methods if not set_ & set(m.excludes) and not outputs & set(m.lacks)]


def reductions(rng, outputs, axes, together):
    asked = {name: some(rng, REDUCTIONS) for name in outputs}
    edges = {name: [-2.5, 0.0, 1.0, 9.0] for name in outputs if "histogram" in asked[name]}
    over = set(some(rng, axes))
    for names in together:
        over |= set(names) if over & set(names) else set()
    return {"over": [name for name in axes if name in over], "outputs": asked, "edges": edges}


def of_beads(rng):
    """Of a kernel with array parameters."""
    outputs = some(rng, ["total", "moment", "share"])
    names = some(rng, ["mass", "place", "g"])
    keys = {"kernel": "beads:KERNEL", "outputs": outputs, "design": "zip", "rtol": 1e-9}
    keys["method"] = rng.choice(["auto", "whole"] + ["quick"] * ("share" not in outputs))
    keys["axes"] = {name: rng.choices(VALUES[name], k=5) for name in names}
    fixed = {name: VALUES[name][rng.choice([0, 3])] for name in ("mass", "place", "g")}
    keys["fixed"] = {n: v for n, v in fixed.items() if n not in names and (n == "mass" or rng.random() < 0.5)}
    return keys


def expected(keys):
    return interpreted(KERNELS[keys["kernel"]], keys)


def drawn_and_expected(seed, **how):
    """A study that has something to run, and what comes out of it; another one where this one has not."""
    keys = drawn(seed, **how)
    wanted = expected({name: value for name, value in keys.items() if name != "summary"})
    if (wanted["status"][1] == Status.NOT_ASKED).all():
        with pytest.raises(sweep.SweepError, match="where"):
            run(keys)
        return drawn_and_expected(seed + 10_000, **how)
    return keys, wanted if "summary" not in keys else expected(keys)


def run(keys, path=None, **options):
    return sweep.run(keys, path, **{"progress": False, "allow_import": True, "workers": 1, **options})


def agree(found, wanted):
    """Dimensions and bits are those of the interpreter."""
    assert set(found.data_vars) == set(wanted)
    for name, (dims, values) in wanted.items():
        assert found[name].dims == dims, name
        equal(name, worded(found[name], values), values)


def worded(found, values):
    """Numbers of words as these words."""
    if values.dtype.kind != "U":
        return found.values
    words = dict(zip(found.attrs["flag_values"], found.attrs["flag_meanings"].split(), strict=True))
    return np.array([words[code] for code in found.values.ravel()]).reshape(found.shape)


def equal(name, found, values):
    if name == "error_bound":  # told in float32, rounded up but for rtol itself
        np.testing.assert_array_equal(np.isnan(found), np.isnan(values))
        with np.errstate(invalid="ignore"):
            assert (np.isnan(values) | ((found >= values * (1 - 6e-8)) & (found <= values * (1 + 3e-7)))).all()
    elif name.endswith("_mean"):
        np.testing.assert_array_equal(found, values)
    else:
        assert found.astype(values.dtype).tobytes() == values.tobytes(), (name, found, values)


def coordinates_agree(found, keys):
    """Axes and fixed parameters are there as they were given."""
    blocks = keys.get("blocks", [keys])
    for name, values in ((n, v) for block in blocks for n, v in block["axes"].items()):
        words = found[name].attrs.get("flag_meanings", "").split()
        got = found[name].values
        if isinstance(values[0], str) and got.dtype.kind not in "UTO":
            got = [words[list(found[name].attrs["flag_values"]).index(v)] for v in got]
        np.testing.assert_array_equal(got, values)
    for name, value in keys.get("fixed", {}).items():
        if not isinstance(value, str):
            np.testing.assert_array_equal(found[name].values, value)


@pytest.fixture
def before(monkeypatch):
    """Sets what is called before cells are checked; counts its calls."""

    def before(action):
        count = [0]

        def counted(x):
            count[0] += 1
            action(count[0], x)

        monkeypatch.setattr(dice, "before_check", counted)
        return count

    return before


@pytest.mark.parametrize("seed", range(STUDIES))
def test_every_cell_is_what_the_interpreter_says_however_the_study_is_cut(seed, tmp_path):
    rng, (keys, wanted) = random.Random(seed), drawn_and_expected(seed)
    for _ in range(2):
        found = run(keys, workers=rng.randint(1, 3), block_cells=rng.choice([None, 1, 2, 3, 5, 8, 40]))
        agree(found, wanted)
    coordinates_agree(found, keys)
    toml = tmp_path / "study.toml"
    toml.write_text(sweep.to_toml(sweep.study(keys, allow_import=True)), encoding="utf-8")
    same(run(toml), found)


def test_a_cell_that_raises_costs_one_cell_wherever_it_stands():
    for count in range(2, 10):
        for bad in range(count):
            axis = [dice.RAISES if k == bad else 2.0 + k / 8 for k in range(count)]
            keys = {"kernel": "dice:KERNEL", "method": "solid", "axes": {"x": axis}, "outputs": ["b"]}
            agree(run(keys), expected(keys))


@pytest.mark.parametrize("seed", range(1000, 1000 + STUDIES // 2))
def test_every_reduction_is_what_the_interpreter_says(seed):
    rng, (keys, wanted) = random.Random(seed), drawn_and_expected(seed, summary=True)
    agree(run(keys, workers=rng.randint(1, 3), block_cells=rng.choice([None, 1, 2, 5, 40])), wanted)


def test_rows_of_many_cells_are_reduced_as_one_after_the_other():
    keys = {"kernel": "dice:KERNEL", "outputs": ["a", "b"], "rtol": 1e-6, "method": "solid"}
    keys |= {"axes": {"kind": ["plain", "odd"], "x": list(np.linspace(0.1, 70.0, 751)), "y": [1.0, 2.0]}}
    asked = {"a": ["min", "mean", "argmax"], "b": ["max", "argmin", "histogram"]}
    keys["summary"] = {"over": ["x", "y"], "outputs": asked, "edges": {"b": [-2.5, 0.0, 1.0, 9.0]}}
    wanted = expected(keys)
    for cells in (None, 100, 3500):
        agree(run(keys, block_cells=cells, workers=2), wanted)


@pytest.mark.parametrize("seed", range(2000, 2000 + STUDIES // 4))
def test_stopped_anywhere_and_continued_a_study_has_the_same_bits(seed, tmp_path, before):
    """Ctrl-C, no memory, or the time that is up; what is there meanwhile is what the interpreter says, or PENDING."""
    rng, (keys, wanted) = random.Random(seed), drawn_and_expected(seed, summary=seed % 4 == 3)
    output, size = tmp_path / "out.h5", rng.choice([None, 1, 3, 6])
    for _ in range(4):
        kind, last = rng.choice(STOPS), rng.choice([1, 2, 3, 5, 8, 13, 21])

        def stop(calls, x, kind=kind, last=last):
            if calls == last or (calls > last and kind is not interrupt):  # a second Ctrl-C would end all at once
                kind()

        before(stop)
        until = datetime.now() + timedelta(seconds=rng.uniform(0.0, 0.3)) if kind is slow else None
        told = None
        try:
            run(keys, output, block_cells=size, workers=rng.randint(1, 2), until=until).close()
        except (KeyboardInterrupt, sweep.SweepError) as fault:
            told = str(fault)
        assert told is None or kind is not exhaust or "memory" in told
        if "summary" not in keys and any(tmp_path.glob("out.h5*")):
            partly_agrees(output, wanted)
    before(lambda calls, x: None)
    with run(keys, output, workers=2) as found:
        agree(found, wanted)
        same(found, run(keys))
    assert sweep.verify(output).whole
    assert [path.name for path in tmp_path.iterdir()] == ["out.h5"]


def interrupt():
    os.kill(os.getpid(), signal.SIGINT)


def exhaust():
    raise MemoryError


def slow():
    time.sleep(0.01)


STOPS = (interrupt, exhaust, slow)


def partly_agrees(output, wanted):
    """Cells of an unfinished result are PENDING and no number, or right."""
    with sweep.open_result(output) as found:
        pending = (found.status == Status.PENDING).values
        for name, (dims, values) in wanted.items():
            assert found[name].dims == dims
            equal(name, found[name].values[~pending], values[~pending])
            nothing = {"status": Status.PENDING, "method_used": -1}.get(name, np.nan)
            np.testing.assert_array_equal(found[name].values[pending], nothing)


def thinned(rng, keys):
    """The study without some of its values."""
    axes = {}
    for name, values in keys["axes"].items():
        keep = some(rng, range(len(values)))
        axes[name] = [values[k] for k in keep]
    return {**keys, "axes": axes}


@pytest.mark.parametrize("seed", range(3000, 3000 + STUDIES // 4))
def test_an_extended_study_has_the_same_bits_and_computes_the_new_cells_alone(seed, tmp_path, before):
    rng, (keys, wanted) = random.Random(seed), drawn_and_expected(seed, design="product")
    less = thinned(rng, keys)
    if (expected(less)["status"][1] == Status.NOT_ASKED).all() or less["axes"] == keys["axes"]:
        return
    output = tmp_path / "out.h5"
    run(less, output, block_cells=rng.choice([None, 1, 4])).close()
    last = rng.randint(1, 12)
    before(lambda calls, x: interrupt() if calls == last else None)
    with contextlib.suppress(KeyboardInterrupt):
        run(keys, output, extend=True, block_cells=rng.choice([1, 2, 5])).close()
    before(lambda calls, x: None)
    with run(keys, output, extend=True) as found:
        agree(found, wanted)
        coordinates_agree(found, keys)
    assert sweep.verify(output).whole


@pytest.mark.parametrize("seed", range(4000, 4000 + STUDIES // 3))
def test_joined_studies_are_the_study_of_both(seed, tmp_path):
    rng = random.Random(seed)
    design = rng.choice(["product", "product", "zip"])
    keys, _ = drawn_and_expected(seed, design=design)
    numbers = [n for n, values in keys["axes"].items() if len(values) > 1 and not isinstance(values[0], str)]
    keys.pop("where", None)
    if not numbers:
        return
    if design == "product":
        name = rng.choice(numbers)
        values = sorted({v for v in keys["axes"][name] if v == v})
        cut = rng.randint(1, max(1, len(values) - 1))
        halves = values[:cut], values[cut - rng.randint(0, 1) :]
        parts = [{**keys, "axes": {**keys["axes"], name: half}} for half in halves if half]
        whole = {**keys, "axes": {**keys["axes"], name: values}}
    else:
        points = list(dict.fromkeys(zip(*keys["axes"].values(), strict=True)))
        cut = rng.randint(1, max(1, len(points) - 1))
        lists = [list(zip(*some, strict=True)) for some in (points[:cut], points[cut:], points) if some]
        *parts, whole = [{**keys, "axes": dict(zip(keys["axes"], map(list, p), strict=True))} for p in lists]
    if len(parts) < 2 or any(all(x in (dice.RAISES, -1.0) for x in p["axes"].get("x", [1.0])) for p in parts):
        return
    found = sweep.join(*(run(part) for part in parts), rng.choice([None, tmp_path / "out.h5"]))
    with found:
        agree(found, expected(whole))
        coordinates_agree(found, whole)


def test_cells_that_raised_are_computed_again(tmp_path, monkeypatch):
    keys = {"kernel": "dice:KERNEL", "axes": {"x": [3.0, dice.RAISES, 8.0], "y": VALUES["y"]}, "outputs": ["a"]}
    output = tmp_path / "out.h5"
    run(keys, output, block_cells=2).close()
    with sweep.open_result(output) as found:
        agree(found, expected(keys))
        assert (found.status.sel(x=dice.RAISES) == Status.FAILED).any()
    monkeypatch.setattr(dice, "RAISES", -1.0)
    wanted = expected(keys)
    with run(keys, output, retry_failed=True, block_cells=3) as found:
        agree(found, wanted)


@pytest.mark.parametrize("seed", [5000, 5001, 5002])
def test_cells_in_processes_of_their_own_have_the_same_bits(seed, tmp_path):
    keys, wanted = drawn_and_expected(seed, summary=seed == 5002)
    with run(keys, tmp_path / "out.h5", isolate=True, workers=2, block_cells=7) as found:
        agree(found, wanted)


def test_workers_elsewhere_give_the_same_bits(tmp_path):
    with served() as (address, _):
        for seed in range(6000, 6006):
            keys, wanted = drawn_and_expected(seed, summary=seed == 6005)
            path = None if seed == 6000 else tmp_path / f"{seed}.h5"
            with run(keys, path, workers=None, cluster=address, block_cells=[2, 5, None][seed % 3]) as found:
                agree(found, wanted)
