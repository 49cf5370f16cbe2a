"""What the study of the milling machine's drive says of the source is so."""

import fula_milling_machine as study
import numpy as np
import pytest

import sweep
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="fifty reduced models; the kernel's own tests run as plain Python")


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    path = tmp_path_factory.mktemp("fula") / "fula_milling_machine.h5"
    sweep.run(sweep.read_study(study.__file__.replace(".py", ".toml")), path, workers=1).close()
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
        (10.6, 10.591, "reproduced"), (10.6, 10.649, "reproduced"), (19.7, 19.756, "rounded"),
        (227.2, 226.916, "rounded"), (387.6, 346.66, "misprinted"), (13, 12.6, "reproduced"),
        ("99.40", 99.44, "rounded"),
    ],
)  # fmt: skip
def test_a_printed_number_is_judged_by_its_last_digit(printed, here, word):
    assert study.verdict(printed, here) == word


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
