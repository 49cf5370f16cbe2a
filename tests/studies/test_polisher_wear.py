"""What the study of the polisher's wear concludes is so, on a coarse grid."""

from dataclasses import replace

import numpy as np
import polisher_wear as study
import pytest

import sweep
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="hundreds of profiles; the kernel's own tests run as plain Python")

RPM = 2 * np.pi / 60


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """The study with some of its machines and radii."""
    path = tmp_path_factory.mktemp("wear") / "polisher_wear.h5"
    fixed = {
        "b": 0.6201, "d": 0.38, "f": 0.405, "omega": 20 * RPM, "b_angle": np.radians(-38.4), "L": 0.5,
        "Omega": 7.3 * RPM, "tool_a": 0.04, "preston": 1e-13, "pressure": 7e3,
    }  # fmt: skip
    axes = {
        "tool_n": [2.0, 1.0], "tool_b": [0.04, 0.08], "e": [0.02, 0.08, 0.1, 0.16],
        "w_x": [0.5, 0.53, 0.54, 0.56, 0.58],
    }  # fmt: skip
    along = {"radius": np.linspace(0.0, 0.1, 26)}
    made = sweep.study(kernel="polisher_wear", rtol=1e-5, axes=axes, fixed=fixed, along=along)
    sweep.run(made, path, workers=1).close()
    return path


@pytest.fixture(scope="module")
def loaded(result):
    """The study of a constant load, at three radii."""
    path = result.with_name("polisher_wear_load.h5")
    made = sweep.study(study.__file__.replace(".py", "_load.toml"))
    made = replace(made, along={"radius": np.array([0.0, 0.05, 0.098])}, rtol=1e-4)
    sweep.run(made, path, workers=1).close()
    return path


@pytest.fixture(scope="module")
def ds(result):
    return study.read(str(result))


def test_the_study_file_has_the_grid_the_conclusions_need():
    read = sweep.study(study.__file__.replace(".py", ".toml"))
    assert list(read.axes) == ["tool_n", "tool_b", "e", "w_x"]
    assert read.along["radius"][0] == 0
    assert {round(100 * x) for x in read.axes["w_x"].values} >= {50, 54, 56, 58}


def test_the_study_draws_its_figure_and_every_statement_holds(result, loaded, capsys):
    assert study.main([str(result), str(loaded)]) == 0
    text = capsys.readouterr().out
    assert " NO" not in text
    assert "ECCENTRICITY" in text
    assert result.with_suffix(".png").read_bytes().startswith(b"\x89PNG")


def test_unevenness_is_that_of_the_area(ds):
    """Wear that grows with r: mean 2/3, mean square 1/2 of the largest and its square."""
    line = ds.assign(wear=ds.wear * 0 + ds.radius)
    expected = np.sqrt(1 / 2 - 4 / 9) / (2 / 3)
    np.testing.assert_allclose(study.scaled(line).uneven, expected, rtol=5e-3)


def test_a_false_wear_makes_the_statements_fail(ds):
    assert not study.centre(ds.assign(wear=1.02 * ds.wear)).holds
    assert not study.worst_error(ds.assign(wear_error=ds.wear * 1e-3)).holds
    even = ds.assign(uneven=ds.uneven * 0 + 0.3)
    assert not any(s.holds for s in study.offsets(even)[1::2])
    assert not study.eccentricities(even)[0].holds
    full = ds.assign(centre=ds.centre * 0 + 1.0)
    assert not any(s.holds for s in study.offsets(full)[::2])
    assert [s.holds for s in study.eccentricities(full)][1:3] == [False, False]


def test_a_middle_that_is_not_worn_is_no_even_wear(ds):
    """At an offset of the tool's half width the tool never reaches the centre; the area hides it."""
    disc = ds.sel(tool_n=2).isel(tool_b=0)
    assert (disc.wear.isel(radius=0).sel(w_x=slice(0.539, None)) == 0).all()
    assert float(study.least_uneven(disc, ("e", "w_x")).centre) == 0
    assert (study.without_hole(disc).uneven.sel(w_x=slice(0.539, None)).isnull()).all()


def test_a_load_that_spares_the_edge_makes_the_statement_fail(ds, loaded):
    with sweep.open_result(loaded) as load:
        assert all(s.holds for s in study.edge(ds, load))
        assert not any(s.holds for s in study.edge(ds, load.assign(wear=0.1 * load.wear)))
