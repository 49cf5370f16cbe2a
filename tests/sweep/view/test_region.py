"""What is saved of a region: the same numbers, and a study of it that can be run."""

import csv

import numpy as np
import pytest

import sweep
from sweep.view import region
from sweep.view.slices import Choice

pytest.importorskip("matplotlib")
MAP = Choice("period", "mu", "R", {"a": 2})


def read(tmp_path, text):
    path = tmp_path / "region.toml"
    path.write_text(text)
    return sweep.study(path)


def test_the_study_of_a_region_is_the_same_scene_on_a_finer_grid(dataset, tmp_path):
    study = read(tmp_path, region.study_text(dataset, MAP, (0.1, 1.0), (0.5, 3.0)))
    mu, R = study.axes["mu"], study.axes["R"]
    assert (mu.spacing, mu.values[0], mu.values[-1], len(mu)) == ("log", 0.1, 1.0, 101)
    assert (R.spacing, R.values[0], R.values[-1], len(R)) == ("linear", 0.5, 2.0, 101)
    assert (study.fixed["a"], study.fixed["phi0"], study.outputs) == (2.0, 1.0, ("period", "amplitude"))
    assert sweep.run(study, progress=False).status.size == 101 * 101


def test_words_and_lists_are_kept(tmp_path):
    study = sweep.study(
        kernel="drivetrain",
        axes={"method": ["direct"], "f_max": [100.0, 200.0]},
        fixed={"J": [1.0, 2.0, 3.0], "k": [1e4, 2e4, 3e4], "reduction": "rivin"},
    )
    dataset = sweep.run(study, progress=False)
    name = next(iter(dataset.data_vars))
    found = read(tmp_path, region.study_text(dataset, Choice(name, "f_max", None, {}), None, None))
    assert found.method == "direct"
    assert found.fixed["reduction"] == study.fixed["reduction"] != 0
    assert found.fixed["J"].tolist() == [1.0, 2.0, 3.0]


def test_a_list_of_cells_has_no_regions():
    study = sweep.study(kernel="foliot", design="zip", axes={"mu": [1.0, 2.0], "a": [1.0, 2.0]}, fixed={"phi0": 1.0})
    with pytest.raises(sweep.SweepError, match="list of cells"):
        region.study_text(sweep.run(study, progress=False), Choice("period", "mu"), None, None)


def test_the_table_has_the_cells_in_view_with_all_outputs(dataset):
    text = region.table(dataset, MAP, None, None).getvalue().decode()
    rows = list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))
    for name in ("period", "amplitude"):
        found = np.array([float(r[name]) for r in rows]).reshape(41, 21)
        assert np.array_equal(found, dataset[name].isel(a=2).values, equal_nan=True)


def test_too_many_cells_are_no_table(dataset, monkeypatch):
    monkeypatch.setattr(region, "MOST_ROWS", 41 * 21 - 1)
    with pytest.raises(sweep.SweepError, match="861 cells are too many"):
        region.table(dataset, MAP, None, None)


def test_the_picture_is_a_picture(dataset):
    assert region.picture(dataset, MAP, None, None).getvalue().startswith(b"\x89PNG")
    assert region.picture(dataset, Choice("period", "mu", "R", {"a": 2}, exponent=True), None, None)


@pytest.mark.parametrize(
    ("wanted", "found"),
    [
        (None, (1.0, 4.0)), ((2.0, 3.0), (2.0, 3.0)), ((3.0, 2.0), (2.0, 3.0)), ((0.0, 9.0), (1.0, 4.0)),
        ((4.0, 9.0), (1.0, 4.0)), ((3.9, 9.0), (3.9, 4.0)), ((0.0, 1.0), (1.0, 4.0)), ((0.0, 1.1), (1.0, 1.1)),
    ],
)  # fmt: skip
def test_a_range_beyond_the_cells_is_all_of_them(wanted, found):
    assert region._clipped(np.array([1.0, 4.0, 2.0]), wanted) == found


def test_a_refined_axis_has_a_hundred_and_one_points_or_as_many_as_before(dataset, tmp_path):
    study = sweep.study(kernel="foliot", axes={"mu": np.linspace(1, 2, 102), "a": [1.0, 2.0]}, fixed={"phi0": 1.0})
    found = read(tmp_path, region.study_text(sweep.run(study, progress=False), Choice("period", "mu", "a"), None, None))
    assert (len(found.axes["mu"]), len(found.axes["a"])) == (102, 101)
    assert found.question.endswith(", in the region shown by sweep view")


def test_whole_numbers_in_the_range_are_kept_as_they_are(tmp_path):
    keys = {"axes": {"flips": [2.0, 4.0, 6.0, 8.0], "mu": [1.0, 2.0]}, "fixed": {"a": 0.5, "phi0": 1.0, "step": 0.05}}
    dataset = sweep.run(sweep.study(kernel="foliot_steps", **keys), progress=False)
    name = next(iter(dataset.data_vars))
    found = read(tmp_path, region.study_text(dataset, Choice(name, "flips", None, {"mu": 1}), (4.0, 6.0), None))
    assert found.axes["flips"].values.tolist() == [4.0, 6.0]
    assert found.fixed["mu"] == 2.0


def test_a_result_of_no_known_study_has_no_regions(dataset):
    bare = dataset.drop_attrs(deep=False)
    with pytest.raises(sweep.SweepError, match="does not say which study"):
        region.study_text(bare, MAP, None, None)


def test_lines_of_the_table_are_the_cells_in_view(dataset, monkeypatch):
    assert region.rows(dataset, MAP, None, None) == 41 * 21
    assert region.rows(dataset, Choice("period", "mu", None, {"a": 2, "R": 0}), None, None) == 41
    monkeypatch.setattr(region, "MOST_ROWS", 41 * 21)
    header = region.table(dataset, MAP, None, None).getvalue().decode().split("\n")
    assert not any("place along" in line for line in header)
