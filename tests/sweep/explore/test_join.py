"""Two results as one, against the sweep of both."""

import dataclasses

import numpy as np
import pytest
from toy_studies import build

import sweep
from sweep.cli import main
from sweep.study.model import Axis

HEIGHTS = [1.0, 2.0, 4.0, 8.0]


def same(found, whole):
    """Every number and coordinate of cells is the same."""
    for name in ("fall_time", "status", "method_used", "error_bound"):
        assert found[name].dims == whole[name].dims
        assert found[name].values.tobytes() == whole[name].values.tobytes(), name
    for dim in whole.fall_time.dims:
        if dim in whole.coords:
            assert found[dim].values.tolist() == whole[dim].values.tolist()


def of(**keys):
    return sweep.run(build(**{"axes": {"height": HEIGHTS, "v0": [0.0, 1.0]}, **keys}))


@pytest.mark.parametrize(
    ("one", "other"),
    [([1.0, 2.0], [4.0, 8.0]), ([4.0, 8.0], [1.0, 2.0]), ([1.0, 4.0], [2.0, 8.0]), ([1.0, 2.0, 4.0], [2.0, 4.0, 8.0])],
)
def test_an_axis_becomes_longer(one, other):
    parts = [of(axes={"height": values, "v0": [0.0, 1.0]}) for values in (one, other)]
    same(sweep.join(*parts), of())


@pytest.mark.parametrize(
    ("keys", "name", "values"),
    [
        ([{"method": "exact"}, {"method": "rough"}], "method", ["exact", "rough"]),
        ([{"rtol": 1e-3}, {"rtol": 1e-6}], "rtol", [1e-3, 1e-6]),
        ([{"fixed": {"g": 9.0}}, {"fixed": {"g": 2.0}}], "g", [9.0, 2.0]),
    ],
)
def test_a_setting_or_a_fixed_parameter_becomes_an_axis(keys, name, values):
    found = sweep.join(*(of(**each) for each in keys))
    whole = of(axes={name: values, "height": HEIGHTS, "v0": [0.0, 1.0]})
    same(found, whole)


def test_points_are_put_behind_each_other():
    halves = [of(design="zip", axes={"height": h, "v0": v}) for h, v in (([1.0, 2.0], [0.0, 1.0]), ([3.0], [2.0]))]
    same(sweep.join(*halves), of(design="zip", axes={"height": [1.0, 2.0, 3.0], "v0": [0.0, 1.0, 2.0]}))


def test_points_that_are_in_both_are_kept_once():
    parts = [
        of(design="zip", axes={"height": h, "v0": v}) for h, v in (([1.0, 2.0], [0.0, 1.0]), ([2.0, 2.0], [2.0, 1.0]))
    ]
    same(sweep.join(*parts), of(design="zip", axes={"height": [1.0, 2.0, 2.0], "v0": [0.0, 1.0, 2.0]}))
    parts[1].fall_time[1] *= 1 + 1e-12
    with pytest.raises(sweep.SweepError, match=r"(?s)cells that are in both differ.*e\.g\. height=2 v0=1"):
        sweep.join(*parts)


def test_refined_results_that_share_a_border_are_joined_to_one_that_can_be_refined(tmp_path):
    studies = [build(axes={"height": h, "v0": [1.0, 3.0, 9.0]}) for h in ([1.0, 4.0, 16.0], [16.0, 64.0, 256.0])]
    parts = [sweep.refine(sweep.run(study), "fall_time", 5e-2, study=study).dataset for study in studies]
    cells = [set(zip(p.height.values.tolist(), p.v0.values.tolist(), strict=True)) for p in parts]
    assert len(cells[0] & cells[1]) >= 3
    joined = sweep.join(*parts, tmp_path / "both.h5")
    found = list(zip(joined.height.values.tolist(), joined.v0.values.tolist(), strict=True))
    assert len(found) == len(set(found)) == len(cells[0] | cells[1])
    own = dataclasses.replace(
        studies[0], design="zip", axes={n: Axis(n, joined[n].values, "values") for n in studies[0].axes}
    )
    assert sweep.refine(joined, "fall_time", 5e-2, study=own).complete
    assert sweep.join(parts[0], joined).sizes == joined.sizes


def test_a_new_axis_has_labels_and_a_file_that_opens(tmp_path):
    a, b = of(), of()
    found = sweep.join(a, b, tmp_path / "c.h5", axis="version", labels=["0.1", "0.2"])
    assert found.version.values.tolist() == ["0.1", "0.2"]
    for label in ("0.1", "0.2"):
        assert sweep.diff(found.sel(version=label, drop=True), a).same
    assert "0.1: foliot" in found.attrs["taken_over"]
    found.close()
    assert sweep.verify(tmp_path / "c.h5").whole
    with pytest.raises(sweep.SweepError, match="another study"):
        sweep.run(build(axes={"height": HEIGHTS, "v0": [0.0, 1.0]}), tmp_path / "c.h5")


def test_a_new_axis_of_points():
    a = of(design="zip", axes={"height": [1.0, 2.0], "v0": [0.0, 1.0]})
    found = sweep.join(a, a, axis="version")
    assert found.fall_time.dims == ("version", "point")
    assert found.height.dims == ("point",)
    assert np.array_equal(found.fall_time[1], a.fall_time)


@pytest.mark.parametrize(
    ("results", "options", "message"),
    [
        (lambda: (of(), of()), {}, "they do not differ; name a new axis"),
        (lambda: (of(), of(fixed={"g": 2.0}, rtol=1e-3)), {}, "they differ in fixed.g and rtol"),
        (
            lambda: (of(), of(fixed={"g": 2.0})),
            {"axis": "version"},
            "all else is to be the same; they differ in fixed.g",
        ),
        (lambda: (of(), of()), {"axis": "height"}, "cannot be the name of a new axis"),
        (lambda: (of(), of()), {"axis": "a b"}, "cannot be the name of a new axis"),
        (lambda: (of(), of()), {"axis": "version", "labels": ["x", "x"]}, "two labels that differ"),
        (lambda: (of(), of(summary={})), {}, "keep their cells"),
        (lambda: (of(), of(where="height > 1")), {}, "they differ in where"),
    ],
)
def test_what_does_not_fit_is_refused(results, options, message):
    with pytest.raises(sweep.SweepError, match=message):
        sweep.join(*results(), **options)


def test_cells_of_both_that_differ_are_refused():
    a, b = of(axes={"height": [1.0, 2.0]}), of(axes={"height": [2.0, 4.0]})
    b.fall_time[0] *= 1 + 1e-12
    with pytest.raises(sweep.SweepError, match="cells that are in both differ"):
        sweep.join(a, b)


def test_the_command(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name, heights in (("a.h5", [1.0, 2.0]), ("b.h5", [4.0, 8.0])):
        sweep.run(build(axes={"height": heights, "v0": [0.0, 1.0]}), name).close()
    assert main(["join", "a.h5", "b.h5", "-o", "c.h5"]) == 0
    assert "8 cells: 8 ok" in capsys.readouterr().out
    same(sweep.open_result("c.h5"), of())
    assert main(["join", "a.h5", "a.h5", "-o", "d.h5", "--axis", "version", "--labels", "old", "new"]) == 0
    assert main(["show", "d.h5"]) == 0
    assert "version" in capsys.readouterr().out
    assert main(["join", "a.h5", "b.h5", "-o", "a.h5", "--force"]) == 2


@pytest.mark.parametrize("name", ["join", "diff"])
@pytest.mark.parametrize(
    ("given", "found"),
    [((["a.h5"],), "found list;"), (("a.h5", "b.h5"), "found str and str;"), ((1, None), "found int;")],
)
def test_what_are_not_two_results_is_named_with_what_to_write(name, given, found):
    with pytest.raises(sweep.SweepError, match=rf"sweep\.{name}: expected two Datasets, {found}.* sweep\.open_result"):
        getattr(sweep, name)(*given)


@pytest.mark.parametrize(("axis", "labels"), [(3, ["0.1", "0.2"]), ("version", 3)])
def test_an_axis_that_is_no_name_and_labels_that_are_no_list_are_refused(axis, labels):
    with pytest.raises(sweep.SweepError, match="new axis"):
        sweep.join(of(), of(), axis=axis, labels=labels)


def test_a_join_of_other_cells_or_labels_is_never_taken_for_the_one_that_is_there(tmp_path):
    """The studies of all three are the same, and so is what differs in the programs: some source has changed."""
    a, b, c = of(), of(), of()
    b.fall_time[0] += 1.0
    c.fall_time[0] += 2.0
    path, begun = tmp_path / "j.h5", tmp_path / "k.h5"

    def joined(other, labels=("old", "new"), path=path, **options):
        with sweep.join(a, other, path, axis="version", labels=labels, **options) as found:
            assert found.version.values.tolist() == list(labels)
            assert np.array_equal(found.fall_time[1], other.fall_time)
        return path.read_bytes()

    for other, labels in ((c, ("old", "new")), (b, ("1", "2"))):
        whole = joined(b, force=True)
        assert joined(b) == whole  # the same one, which is there
        with pytest.raises(sweep.SweepError, match="--force"):
            joined(other, labels)
        assert path.read_bytes() == whole
        joined(other, labels, force=True)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("sweep.system.disk.rename", killed_at(begun))
            with pytest.raises(KeyboardInterrupt):
                joined(b, path=begun)
        with pytest.raises(sweep.SweepError, match="--force"):
            joined(other, labels, path=begun)
        joined(b, path=begun)
        begun.unlink()


def killed_at(target):
    """Renames, but is killed before a result gets its name."""

    def rename(old, new):
        if new == target:
            raise KeyboardInterrupt
        old.replace(new)

    return rename
