"""What the study of work and precision concludes is so, on few cells and tolerances."""

from pathlib import Path

import numpy as np
import oracles
import pytest
import work_precision as study
import xarray as xr

import sweep
from kernels.lanes.jit import COMPILED
from sweep.explore.work_precision import precision_cells, work_precision

STUDIES = Path(study.__file__).parent
FILE = STUDIES / "work_precision.toml"
CELLS = 6 if COMPILED else 3
TOLERANCES = (1e-4, 1e-10)
METHODS = ("auto", "coulomb", "quadrature")


@pytest.fixture(scope="module")
def coulomb():
    few = sweep.study(FILE)
    return work_precision(few, methods=METHODS, cells=CELLS, tolerances=TOLERANCES, truth=study.cycles(few, CELLS))


@pytest.fixture(scope="module")
def steps():
    """An integrator of order p whose error is h^p/10, three calls a step."""
    h = np.geomspace(1e-3, 0.25, 17)
    order = {"euler": 1, "semi_implicit": 1, "verlet": 2, "rk4": 4, "dopri5": 5, "dop853": 8}
    error = (("method", "step"), [h**p / 10 for p in order.values()])
    calls = (("method", "step"), [3 / h for _ in order])
    coords = {"method": list(order), "step": h}
    return xr.Dataset({"error_median": error, "error_worst": error, "rate_calls": calls}, coords)


def test_truth_is_that_of_the_cells_in_their_order():
    few = sweep.study(FILE)
    true, cells = study.cycles(few, 3), precision_cells(few, 3)
    assert list(true) == ["period", "amplitude", "crossing_speed"]
    for i, (a, R) in enumerate(zip(cells["a"], cells["R"], strict=True)):
        # with either friction alone it swings wider
        assert 1 < true["amplitude"][i] < min(float(oracles.foliot(1.0, 1.0, a)[1]), 1 / R)
    a, R = cells["a"][-1], cells["R"][-1]
    assert a == 10
    assert true["period"][-1] == pytest.approx(4 * a / (1 - R), rel=1e-3)  # it drifts: (1 - R)/a is its speed
    assert true["amplitude"][0] > true["amplitude"][-1] > 1


def test_no_method_is_silently_wrong_and_auto_is_right(coulomb):
    assert [s.what for s in study.honesty("x", coulomb) if not s.holds] == []
    assert coulomb.attrs["reference"] == "the truth given"
    assert float(coulomb.error_worst.max()) < 1e-12


def test_a_method_that_lies_is_seen(coulomb):
    lying = coulomb.assign(silent=coulomb.silent + 0.1, unsolved=coulomb.unsolved + 0.1)
    lying = lying.assign(error_worst=coulomb.error_worst + 2e-4)
    lying.attrs = coulomb.attrs
    assert [s.holds for s in study.honesty("x", lying)] == [False, False, False]


def test_costs_are_those_of_the_first_tolerance_that_suffices(coulomb):
    auto = next(s for s in study.costs(coulomb) if s.what.startswith("auto"))
    least = 1e6 * float(coulomb.seconds.sel({"method": "auto"}).min())
    assert auto.here.split(", ")[0] == f"{least:.3g}"
    none = coulomb.assign(error_worst=coulomb.error_worst + 1)
    assert all(s.here == "-, -, -" for s in study.costs(none))


def test_orders_are_the_exponents_of_the_error(steps):
    lines = {s.what.split(":")[0]: s for s in study.orders(steps)[:4]}
    assert [float(lines[name].here) for name in study.ORDERS] == pytest.approx([1, 1, 2, 4])
    assert all(s.holds for s in lines.values())
    flat = steps.assign(error_median=steps.error_median**1.1)
    assert not any(s.holds for s in study.orders(flat)[:4])


def test_calls_are_counted_to_seven_digits(steps):
    rk4 = next(s for s in study.orders(steps) if s.what.startswith("rk4: calls"))
    h = float(steps.step.where(steps.step**4 / 10 <= 1e-7).max())
    assert float(rk4.here) == pytest.approx(3 / h, rel=1e-3)


def test_the_figure_has_two_rows_of_three_panels(coulomb, steps):
    other = xr.Dataset({k: ("rtol", [1e-4, 1e-9]) for k in ("error_median", "error_worst", "seconds")})
    page = study.figure(coulomb, coulomb, steps, {"heyoka.py": other, "diffrax": other})
    assert len(page.axes) == 6
    assert [axes.get_title(loc="left") for axes in page.axes[:3]] == ["(a)", "(b)", "(c)"]
    assert "heyoka.py" in [text.get_text() for text in page.legends[0].get_texts()]
    assert len(study.figure(coulomb, coulomb, None, {}).axes) == 6


@pytest.mark.parametrize(
    ("name", "rtol", "right_to"), [("heyoka.py", 1e-9, 1e-8), ("diffrax", 1e-9, 1e-6), ("scipy", 1e-7, 1e-6)]
)
def test_others_find_the_same_cycle(monkeypatch, name, rtol, right_to):
    import _peers

    if name not in _peers.FOLLOWERS:
        pytest.skip(f"{name} is not installed")
    monkeypatch.setattr(study, "PEER_CELLS", 2)
    monkeypatch.setattr(_peers, "FOLLOWERS", {name: _peers.FOLLOWERS[name]})
    found = study.peers(FILE, (rtol,))[name]
    assert float(found.error_worst.max()) < right_to
    assert float(found.seconds.min()) > 0


def test_the_study_prints_its_table_and_draws_its_figure(coulomb, steps, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(study, "charted", lambda *_: coulomb)
    monkeypatch.setattr(study, "stepped", lambda *_: steps)
    monkeypatch.setattr(study, "peers", lambda *_: {})
    assert study.main([str(tmp_path / "work_precision.toml")]) == 0
    text = capsys.readouterr().out
    assert " NO" not in text
    assert "not installed" in text
    assert (tmp_path / "work_precision.png").read_bytes().startswith(b"\x89PNG")
