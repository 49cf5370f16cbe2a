"""What the study of the milling machine's drive says of the source is so."""

import _fula_source
import fula_milling_machine as study
import numpy as np
import pytest

import sweep
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="fifty reduced models; the kernel's own tests run as plain Python")


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    path = tmp_path_factory.mktemp("fula") / "fula_milling_machine.h5"
    sweep.run(sweep.study(study.__file__.replace(".py", ".toml")), path, workers=1).close()
    return path


@pytest.fixture(scope="module")
def ds(result):
    return study.read(str(result))


def test_the_study_draws_its_figure_and_every_statement_holds(result, capsys):
    assert study.main([str(result)]) == 0
    assert " NO" not in capsys.readouterr().out
    assert result.with_suffix(".png").read_bytes().startswith(b"\x89PNG")


def test_the_units_of_the_source_are_those_of_the_file(ds):
    chain = study.chain(ds, 8)
    np.testing.assert_allclose(chain["J"], [25.7, 1.25, 0.284, 0.769, 1.45, 6.5, 96, 99.44], rtol=1e-14)
    np.testing.assert_allclose(chain["k"][[0, 7]], [7530, 1192], rtol=1e-14)
    np.testing.assert_allclose(chain["h"][7], 13, rtol=1e-14)


@pytest.mark.parametrize(
    ("printed", "here", "word"),
    [
        (10.6, 10.591, "reproduced"), (10.6, 10.649, "reproduced"), (19.7, 19.756, "near"),
        (227.2, 226.916, "near"), (50.2, 48.845, "slip"), (387.6, 346.66, "misprinted"), (13, 12.6, "reproduced"),
        ("99.40", 99.44, "near"),
    ],
)  # fmt: skip
def test_a_printed_number_is_judged_by_its_last_digit(printed, here, word):
    assert _fula_source.verdict(printed, here) == word


def test_the_five_masses_of_the_source_are_too_low_at_the_fifth_frequency(ds):
    assert ds.frequency.sel(n_keep=5).isel(reduction=0).values[4] == pytest.approx(187.33, abs=0.01)
    assert np.isnan(ds.frequency.sel(n_keep=5).isel(reduction=0).values[5])


@pytest.mark.parametrize(
    ("f", "real", "dampers"), [(187.3, 0.176, 0.180), (200, 0.0906, 0.0907), (226.9, 0.2666, 0.2667)]
)
def test_the_cause_is_the_inertia_and_not_the_dampers(ds, f, real, dampers):
    assert study.error_at(ds, f, "real") == pytest.approx(real, rel=0.02)
    assert study.error_at(ds, f, "complex") == pytest.approx(dampers, rel=0.02)
    assert study.error_at(ds, f, "mu") < 1e-12


def test_a_false_frequency_makes_a_statement_fail(ds):
    wrong = ds.assign(frequency=1.03 * ds.frequency)
    assert not all(s.holds for s in study.frequencies(wrong) if s.holds is not None)


def test_a_false_chain_makes_a_statement_fail(ds):
    wrong = ds.assign(h_kept=2 * ds.h_kept)
    assert not all(s.holds for s in study.tables(wrong) if s.holds is not None)


def test_a_number_half_a_percent_off_is_no_longer_near(ds):
    wrong = ds.assign(frequency=1.006 * ds.frequency)
    assert sum(s.failed for s in study.frequencies(wrong)) >= 8


def test_the_partial_systems_are_those_of_the_chain(ds):
    """J e of a at J3 and of b at spring 2 by hand: the tie of the source."""
    rows = _fula_source.partial_systems(*(study.chain(ds, 8)[name] for name in "Jk"))
    assert rows["J e of a"][3] == pytest.approx(0.284 / (3.790 + 0.839), rel=1e-12)
    assert rows["J e of b"][2] == pytest.approx(1.25 * 0.284 / 1.534 / 3.790, rel=1e-12)
    assert rows["J of b"][7] == pytest.approx(48.845, rel=1e-4)


def test_the_rounded_flexibilities_of_table_2_do_not_give_the_printed_frequencies(ds):
    chain = study.chain(ds, 8)
    found = _fula_source.holzer(chain["J"], _fula_source.TABLE_2_E)
    np.testing.assert_allclose(found[3:5], [102.43, 226.93], rtol=5e-4)
    exact = ds.frequency.sel(n_keep=8).isel(reduction=0)
    np.testing.assert_allclose(_fula_source.holzer(chain["J"], 1e3 / chain["k"]), exact, rtol=1e-11)


def test_the_conclusions_have_the_numbers_of_an_own_solution(ds):
    """By numpy.linalg.solve of the damped chain."""
    chain = study.source_chain(ds)

    def grid(c):
        return np.diag(c + np.concatenate([[0.0], c[:-1]])) - np.diag(c[:-1], 1) - np.diag(c[:-1], -1)

    w = 2 * np.pi * 230.0
    matrix = grid(chain["k"]) + 1j * w * grid(chain["h"]) - w**2 * np.diag(chain["J"])
    true = np.linalg.solve(matrix, np.eye(8)[0])[0]
    assert study.responses(ds, np.array([230.0]))[0][0] == pytest.approx(true, rel=1e-12)
    text = " ".join(s.here for s in study.conclusions(ds))
    assert "1/758 at 230 Hz" in text
    assert "590 Hz" in text


def test_a_false_damping_makes_conclusions_fail(ds):
    wrong = ds.assign(damping=ds.damping.where(ds.n_keep != 5, 1.1 * ds.damping), valid_to=0 * ds.valid_to + 160)
    assert not any(s.failed for s in study.conclusions(ds))
    assert sum(s.failed for s in study.conclusions(wrong)) == 2


def test_the_errors_of_the_other_methods_are_those_of_50_digits(ds):
    assert not any(s.failed for s in study.others(ds))
    wrong = ds.assign(frequency_error=ds.frequency_error + 0.003)
    assert all(s.failed for s in study.others(wrong)[1:-1])
