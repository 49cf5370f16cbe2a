"""Every study in `studies/` is sound, and what the foliot's scaling study concludes is so, on a coarse grid."""

import importlib.util
import math
import re
import sys
from pathlib import Path

import _common
import mpmath
import numpy as np
import pytest
import xarray as xr

import sweep

STUDIES = Path(__file__).parents[2] / "studies"

HALF_ALPHA = 1.46299058758010465706
HALF_AP = 6.42446119521106945636
HALF_A = 1.39341841440363426389
"""The point of exponent -1/2 to 20 digits: q - tanh q = 1/alpha and (1 - tanh(q)/q)/tanh(q)^2 = 1/2 at once."""


@pytest.mark.parametrize(
    "name", [p.stem for p in STUDIES.glob("*.py") if "return report(" in p.read_text() and p.stem != "_common"]
)
def test_a_script_is_used_as_its_head_and_its_study_say(name, capsys):
    module = importlib.import_module(name)
    assert module.main([]) == 2
    words = capsys.readouterr().err.removeprefix("use: python ").split()[1:]
    for text in (module.__doc__, (STUDIES / f"{name}.toml").read_text().replace("#", "")):
        used = re.search(rf"python studies/{name}\.py((?:\s+[\w./\\]+\.(?:h5|toml)|\s+\\\n)+)", text)
        assert [Path(word).name for word in used[1].replace("\\", "").split()] == words


@pytest.fixture(scope="module")
def scaling():
    """The module studies/foliot_scaling.py."""
    spec = importlib.util.spec_from_file_location("foliot_scaling", STUDIES / "foliot_scaling.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["foliot_scaling"] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules["foliot_scaling"]


@pytest.fixture(scope="module")
def coarse():
    """The study with 12 points a decade instead of 100, and clock-like constants that are not one."""
    return sweep.study(
        kernel="foliot",
        rtol=1e-14,
        axes={"mu": {"spacing": "log", "start": 1e-7, "stop": 1e7, "num": 14 * 12 + 1}},
        fixed={"a": 1.3, "phi0": 0.4},
    )


@pytest.fixture(scope="module")
def result(coarse, tmp_path_factory):
    path = tmp_path_factory.mktemp("scaling") / "foliot_scaling.h5"
    sweep.run(coarse, path, workers=1).close()
    return path


@pytest.fixture(scope="module")
def ds(scaling, result):
    return scaling.read(str(result))


@pytest.fixture(scope="module")
def groups(scaling, ds):
    return scaling.statements(ds)


def q_of(alpha):
    """Quarter period a P/4, the root of q - tanh q = 1/alpha, by bisection to 30 digits."""
    with mpmath.workdps(40):
        k = 1 / mpmath.mpf(alpha)
        low, high = k, k + 1 + mpmath.cbrt(3 * k)
        while high - low > high * mpmath.mpf(10) ** -30:
            q = (low + high) / 2
            low, high = (q, high) if q - mpmath.tanh(q) < k else (low, q)
        return low


@pytest.mark.parametrize("path", sorted(STUDIES.glob("*.toml")), ids=lambda path: path.stem)
def test_a_study_file_opens_with_its_question_and_holds_no_mistake(path):
    study = sweep.study(path, allow_import=True)
    assert path.read_text().startswith("# ")
    assert study.question.endswith("?")
    assert study.title


@pytest.mark.parametrize("picture", sorted(STUDIES.glob("*.png")), ids=lambda path: path.stem)
def test_a_picture_has_a_caption_of_two_to_four_sentences(picture):
    text = picture.with_suffix(".md").read_text(encoding="utf-8")
    assert 2 <= len(re.findall(r"\.(?=\s|$)", text)) <= 4


def test_the_study_covers_ten_decades_of_alpha_around_one_finely():
    study = sweep.study(STUDIES / "foliot_scaling.toml")
    alpha = study.axes["mu"].values / (study.fixed["a"] ** 2 * study.fixed["phi0"])
    assert alpha[0] < 1e-6
    assert alpha[-1] > 1e6
    assert np.diff(np.log10(alpha)).max() <= 1 / 40
    assert (study.kernel_name, study.method, study.fixed["phi0"]) == ("foliot", "auto", pytest.approx(math.pi / 6))


def test_every_statement_of_the_paper_that_can_be_checked_holds(groups):
    checked = [s for lines in groups.values() for s in lines if s.holds is not None]
    assert [s.what for s in checked if not s.holds] == []
    assert len(checked) == sum(map(len, groups.values())) == 46


def test_scaled_values_are_those_of_the_closed_form(ds):
    for i in (0, 60, 84, 100, -1):
        q = q_of(float(ds.alpha[i]))
        assert float(ds.aP[i]) == pytest.approx(float(4 * q), rel=1e-13)
        assert float(ds.A[i]) == pytest.approx(float(ds.alpha[i]) * float(mpmath.log(mpmath.cosh(q))), rel=1e-9)


def test_the_point_of_exponent_minus_one_half_to_thirteen_digits(scaling, ds):
    half = scaling.half_point(ds)
    np.testing.assert_allclose([half.alpha, half.aP, half.A], [HALF_ALPHA, HALF_AP, HALF_A], rtol=1e-13)
    assert half.error < 1e-9


def test_differences_of_the_period_find_the_same_point_within_their_estimated_error(scaling, ds):
    found = scaling.where_exponent(ds.aP, "alpha", -0.5)
    assert abs(float(found.abscissa) - HALF_ALPHA) < float(found.abscissa_error) < 1e-3


def test_fitted_exponents_are_near_their_limits_by_the_known_corrections(scaling, ds):
    weak, strong = (scaling.fit_exponent(ds.aP, "alpha", w) for w in (scaling.WEAK, scaling.STRONG))
    # -1/(1 + alpha) lies above -1, and -1/3 - (4/45)(3/alpha)^(2/3) below -1/3; the fit is a mean over the window
    assert 0 < float(weak.exponent) + 1 < 1e-5
    assert 0 < -1 / 3 - float(strong.exponent) < 4 / 45 * (3 / 1e5) ** (2 / 3)
    assert float(weak.prefactor) == pytest.approx(4, rel=1e-3)
    assert float(strong.prefactor) == pytest.approx(4 * 3 ** (1 / 3), rel=1e-3)


def test_the_exponent_slides_upwards_all_the_way(scaling, ds):
    slope = scaling.local_exponent(ds.aP, "alpha")
    # fourth order at a step of 0.19: h^4/30 of the fifth derivative, at most 1.5 here
    assert float(abs(slope + ds.s).max()) < 1e-4
    assert (slope.diff("mu") > -1e-9).all()


def test_a_false_value_makes_a_statement_fail(scaling, ds):
    wrong = ds.assign(aP=ds.aP * 1.001)
    assert [s.holds for s in scaling.limits(wrong)] == [False, True, False, True]
    steep = ds.assign(aP=ds.aP * ds.alpha**-0.001)
    assert [s.holds for s in scaling.straight_lines(steep)] == [False, False, True, True, True]


def test_a_swing_that_leans_forward_or_loses_more_is_seen(scaling, ds, monkeypatch):
    assert all(s.holds for s in scaling.shape(ds) + scaling.energy(ds))
    motion = scaling.trajectories(ds)
    turned = motion.assign(angle=(motion.angle.dims, np.roll(motion.angle.values[:, ::-1], 401, axis=1)))
    monkeypatch.setattr(scaling, "trajectories", lambda _: turned)
    assert not all(s.holds for s in scaling.shape(ds))
    kept = scaling.sweep_of_alpha
    monkeypatch.setattr(scaling, "sweep_of_alpha", lambda *x: kept(*x).pipe(lambda d: d.assign(s=1.01 * d.s)))
    # two drives whose turn is elsewhere, and dlnP/dlnI of all three
    assert sum(s.holds is False for s in scaling.energy(ds)) == 5


def test_a_false_speed_period_or_point_of_one_half_is_seen(scaling, ds, monkeypatch):
    assert not any(s.failed for s in scaling.estimates(ds) + scaling.sliding(ds, scaling.half_point(ds)))
    fast = ds.assign(crossing_speed=1.001 * ds.crossing_speed)
    assert [s.failed for s in scaling.estimates(fast)] == [True, True]
    moved = scaling.HalfPoint(*(1.0001 * x for x in scaling.HALF[:1]), 0.0, *scaling.HALF[1:])
    assert sum(s.failed for s in scaling.sliding(ds, moved)) == 1
    assert sum(s.failed for s in scaling.sliding(ds.assign(s=1.01 * ds.s), moved)) == 2
    kept = scaling.sweep_of_alpha
    monkeypatch.setattr(scaling, "sweep_of_alpha", lambda *x: kept(*x).pipe(lambda d: d.assign(s=1.01 * d.s)))
    assert sum(s.failed for s in scaling.torque(ds)) == 6
    cycle = kept(ds, scaling.SHOWN.values())
    assert not any(s.failed for s in scaling.taken_out(ds, cycle))
    slow = cycle.assign(crossing_speed=0.98 * cycle.crossing_speed)
    assert all(s.failed for s in scaling.taken_out(ds, slow))


def test_torque_stability_is_the_accuracy_over_the_sensitivity(scaling, ds):
    found = {s.what: s.here for s in scaling.torque(ds) if s.what.startswith("torque stability")}
    assert [float(text.rstrip(" %")) for text in found.values()] == pytest.approx(
        [1.042, 2.083, 3.125, 0.06944, 0.1389, 0.2083], rel=1e-3
    )


def test_nothing_is_said_to_be_the_papers_that_is_masked_there(groups):
    lines = [s for group in groups.values() for s in group]
    for text in ("a P there", "A there", "at alpha, from the exact s"):
        assert [s.paper for s in lines if s.what.strip() == text] == ["read off a figure"]
    numbers = [s.paper for s in lines if re.search(r"\d", s.paper) and not s.paper.startswith("(")]
    assert all(paper.endswith("*") for paper in numbers)


def test_friction_counts_off_the_point_and_not_on_it(scaling, ds):
    half = scaling.half_point(ds)
    assert abs(scaling.friction_exponent(ds, half)) < 1e-8
    weak = scaling.HalfPoint(1e-3, 0.0, 0.0, 0.0)
    assert scaling.friction_exponent(ds, weak) == pytest.approx(2 / 1.001 - 1, rel=1e-6)  # 2s - 1, s = 1/(1 + alpha)


def test_inverse_design_gives_the_clock_that_was_wanted(scaling, ds):
    heading, *rows = scaling.inverse_design(ds)
    assert len(rows) == len(scaling.WANTED)
    for (period, degrees), row in zip(scaling.WANTED, rows, strict=True):
        a, mu = float(row[2]), float(row[3])
        q = q_of(mu / (a**2 * 0.4))
        assert float(4 * q) / a == pytest.approx(period, rel=1e-8)  # ten digits are printed
        assert float(mpmath.log(mpmath.cosh(q))) * mu / a**2 == pytest.approx(math.radians(degrees), rel=1e-8)
        assert max(abs(float(off)) for off in row[4:]) < 1e-13
    assert heading[2:4] == ("a [1/s]", "mu [rad/s^2]")


def test_trajectories_follow_the_solution_between_the_switches(scaling, ds):
    motion = scaling.trajectories(ds)
    for i, alpha in enumerate(scaling.SHOWN.values()):
        q = float(q_of(alpha))
        t = 4 * q * motion.phase.values
        first = t <= 2 * q
        forth = 1 + alpha * ((1 + math.tanh(q)) * -np.expm1(-t) - t)  # u = tanh q at the switch, torque negative
        np.testing.assert_allclose(motion.angle[i][first] / ds.phi0, forth[first], atol=1e-9 * alpha + 1e-9)
        np.testing.assert_allclose(motion.angle[i][400:], -motion.angle[i][:401], atol=1e-9)
        assert float(motion.aP[i]) == pytest.approx(4 * q, rel=1e-12)


def test_the_table_has_aligned_columns(scaling, groups):
    lines = _common.table(groups)
    bars = [[k for k, sign in enumerate(line) if sign == "|"] for line in lines if "|" in line]
    assert len(bars) == 1 + sum(map(len, groups.values()))
    assert all(row == bars[0][: len(row)] and len(row) == 4 for row in bars)


def test_the_study_draws_its_figure_and_prints_its_table(scaling, result, capsys):
    assert scaling.main([str(result)]) == 0
    text = capsys.readouterr().out
    assert " NO" not in text
    assert "1.462990587580" in text
    assert "INVERSE DESIGN, phi0 = 22.9183 degree (not in the paper)" in text
    picture = result.with_suffix(".png")
    assert text.rstrip().endswith(f"figure: {picture}")
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_the_panels_of_the_figure_show_what_they_say(scaling, ds):
    upper, lower, *panels = scaling.figure(ds).axes
    assert [axes.get_title(loc="left") for axes in (upper, lower, panels[0])] == ["(a)", "(b)", "(c)"]
    np.testing.assert_array_equal(upper.lines[0].get_ydata(), ds.aP)
    np.testing.assert_array_equal(upper.lines[1].get_ydata(), ds.A)
    np.testing.assert_array_equal(lower.lines[3].get_ydata(), -ds.s)
    (point,) = (line for line in lower.lines if list(line.get_ydata()) == [-0.5] and line.get_marker() == "o")
    assert point.get_xdata()[0] == pytest.approx(HALF_ALPHA)
    for axes, alpha in zip(panels, scaling.SHOWN.values(), strict=True):
        phase, angle = axes.lines[-1].get_data()
        assert (phase[0], phase[-1]) == (0, 2)
        assert angle[[0, 800, 1600]] == pytest.approx([1, 1, 1], rel=1e-9)
        assert np.max(angle) == pytest.approx(float(mpmath.log(mpmath.cosh(q_of(alpha)))) * alpha, rel=1e-4)


def test_asymptotes_touch_the_curves_at_both_ends(scaling, ds):
    upper = scaling.figure(ds).axes[0]
    weak_p, strong_p, weak_a, strong_a = (line.get_data() for line in upper.lines[2:6])
    ends = {"aP": (weak_p, strong_p), "A": (weak_a, strong_a)}
    for name, (weak, strong) in ends.items():
        assert weak[1][0] == pytest.approx(float(ds[name][0]), rel=1e-5)
        assert strong[1][-1] == pytest.approx(float(ds[name][-1]), rel=1e-4)


@pytest.mark.parametrize("arguments", [[], ["a.h5", "b.h5"]])
def test_the_study_says_how_it_is_used(scaling, capsys, arguments):
    assert scaling.main(arguments) == 2
    assert "use: python foliot_scaling.py foliot_scaling.h5" in capsys.readouterr().err


def test_a_result_that_is_not_there_or_of_another_study_is_one_clear_line(scaling, tmp_path, capsys):
    assert scaling.main([str(tmp_path / "nothing.h5")]) == 2
    other = sweep.study(kernel="foliot", axes={"mu": [1.0, 2.0], "a": [1.0, 2.0]}, fixed={"phi0": 1.0})
    sweep.run(other, tmp_path / "other.h5", workers=1).close()
    assert scaling.main([str(tmp_path / "other.h5")]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 2
    assert "other.h5 is no sweep of the foliot over mu alone" in said[1]


def test_a_statement_that_fails_is_seen_in_the_exit_status(scaling, result, capsys, monkeypatch):
    monkeypatch.setattr(scaling, "torque", lambda ds: [scaling.Statement("what", "1", "2", 1.0, False)])
    assert scaling.main([str(result)]) == 1
    assert re.search(r"what +\| 1 +\| 2 +\| \+1\.0e\+00 +\| NO", capsys.readouterr().out)


def test_too_short_a_sweep_is_a_clear_message_and_no_traceback(scaling, tmp_path, capsys):
    study = sweep.study(kernel="foliot", axes={"mu": [1.0, 2.0, 3.0, 4.0]}, fixed={"phi0": 1.0, "a": 1.0})
    sweep.run(study, tmp_path / "short.h5", workers=1).close()
    assert scaling.main([str(tmp_path / "short.h5")]) == 2
    assert "window" in capsys.readouterr().err


def test_groups_are_formed_without_dimensions(scaling):
    plain = xr.Dataset(
        {"period": ("mu", [2.0]), "amplitude": ("mu", [0.6]), "sensitivity": ("mu", [0.5])},
        coords={"mu": [8.0], "a": 2.0, "phi0": 0.5},
    )
    made = scaling.scaled(plain)
    assert (float(made.alpha[0]), float(made.aP[0]), float(made.A[0])) == (4.0, 4.0, 1.2)
