"""Two results as one, against the sweep of both."""

import json

import numpy as np
import pytest
from running import interrupted, same, tall
from toy_studies import build

import sweep
from kernels.interface import Status

HEIGHTS = [1.0, 2.0, 4.0, 8.0]
AXES = {"axes": {"height": HEIGHTS, "v0": [0.0, 1.0]}}
UNITS = {"fall_time": "ms", "height": "mm", "v0": "km/h", "g": "mm/s^2"}


def of(heights=HEIGHTS, v0=(0.0, 1.0), **keys):
    return sweep.run(build(**{"axes": {"height": heights, "v0": list(v0)}, **keys}))


@pytest.mark.parametrize(
    ("keys", "name", "values"),
    [
        ([{"method": "exact"}, {"method": "rough"}], "method", ["exact", "rough"]),
        ([{"method": "exact"}, {"method": "auto"}], "method", ["exact", "auto"]),
        ([{"rtol": 1e-3}, {"rtol": 1e-6}], "rtol", [1e-3, 1e-6]),
        ([{"fixed": {"g": 9.0}}, {"fixed": {"g": 2.0}}], "g", [9.0, 2.0]),
    ],
)
def test_a_setting_or_a_fixed_parameter_becomes_an_axis(keys, name, values):
    found = sweep.join(*(of(**each) for each in keys))
    same(found, of(axes={name: values, "height": HEIGHTS, "v0": [0.0, 1.0]}))


def test_words_become_an_axis_and_an_axis_of_words_becomes_longer():
    """Words keep the order in which the results are given."""
    keys = {"kernel": "drivetrain", "axes": {"f_max": [100.0, 200.0]}, "fixed": {"J": [1.0, 2.0], "k": [1e4, 2e4]}}
    of_word = {}
    for word in ("rivin", "guyan"):
        of_word[word] = sweep.run({**keys, "fixed": {**keys["fixed"], "reduction": word}})
    joined = sweep.join(of_word["rivin"], of_word["guyan"])
    assert joined.reduction.values.tolist() == ["rivin", "guyan"]
    parts = [of(axes={"height": [1.0, 2.0], "method": [name]}) for name in ("exact", "rough")]
    assert sweep.join(*parts).method.values.tolist() == ["exact", "rough"]


def test_refined_results_that_share_a_border_are_joined_to_one_that_can_be_refined():
    keys = {"kernel": "foliot", "outputs": ["period"], "fixed": {"phi0": 1.0}}
    parts = []
    for mu in ([1.0, 4.0, 16.0], [16.0, 64.0, 256.0]):
        parts.append(sweep.refine(sweep.run(**keys, axes={"mu": mu, "a": [1.0, 3.0, 9.0]}), "period", 5e-2).dataset)
    cells = [set(zip(part.mu.values.tolist(), part.a.values.tolist(), strict=True)) for part in parts]
    joined = sweep.join(*parts)
    assert len(cells[0] & cells[1]) >= 3
    found = list(zip(joined.mu.values.tolist(), joined.a.values.tolist(), strict=True))
    assert len(found) == len(set(found)) == len(cells[0] | cells[1])
    assert sweep.refine(joined, "period", 5e-2).complete
    assert sweep.join(parts[0], joined).sizes == joined.sizes


def test_results_of_blocks_become_longer_along_an_axis_of_their_product():
    def blocks(heights, speeds=(0.0, 1.0)):
        pairs = {"design": "zip", "axes": {"v0": list(speeds), "g": [9.0, 10.0]}}
        return sweep.run(build(blocks=[{"design": "product", "axes": {"height": heights}}, pairs]))

    same(sweep.join(blocks([1.0, 4.0]), blocks([2.0, 4.0])), blocks([1.0, 2.0, 4.0]))
    with pytest.raises(sweep.SweepError, match=r"differ in axes\.v0"):
        sweep.join(blocks([1.0]), blocks([1.0], (0.0, 2.0)))


def test_a_new_axis_has_labels_and_a_file_that_opens(tmp_path):
    a, b = of(), of()
    with sweep.join(a, b, tmp_path / "c.h5", axis="version", labels=["0.1", "0.2"]) as found:
        assert found.version.values.tolist() == ["0.1", "0.2"]
        for label in ("0.1", "0.2"):
            assert sweep.diff(found.sel(version=label, drop=True), a).same
            assert f"{label}: foliot" in found.attrs["taken_over"]
    assert sweep.verify(tmp_path / "c.h5").whole
    with pytest.raises(sweep.SweepError, match="another study"):
        sweep.run(build(axes={"height": HEIGHTS, "v0": [0.0, 1.0]}), tmp_path / "c.h5")
    keys = {"kernel": "beads:KERNEL", "allow_import": True, "axes": {"g": [1.0]}, "fixed": {"mass": [1.0, 2.0]}}
    beads = sweep.run(**keys, outputs=["total"])  # no output runs along the beads
    assert sweep.join(beads, beads, axis="v", labels=["a", "b"]).total.values.tolist() == [[3.0], [3.0]]


def unfinished():
    found = of()
    found.status[1, 1] = Status.PENDING
    return found


def of_other_sources():
    found = of([16.0])
    mark = json.loads(found.fingerprint)
    own = next(name for name in mark if name.startswith("source ") and "kernels" not in name and "sweep" not in name)
    return found.assign_attrs(fingerprint=json.dumps({**mark, own: "0"}))


@pytest.mark.parametrize(
    ("results", "options", "message"),
    [
        (lambda: (of(), of()), {}, "name a new axis"),
        (lambda: (of(), of(fixed={"g": 2.0}, rtol=1e-3)), {}, "fixed.g and rtol"),
        (lambda: (of(), of(fixed={"g": 2.0})), {"axis": "version"}, "fixed.g$"),
        (lambda: (of(), of(fixed={"g": 2.0})), {"axis": "g"}, "joined along g"),
        *((lambda: (of(), of()), {"axis": name}, "new axis") for name in ("height", "rtol", "fall_time", "a b", 3)),
        *((lambda: (of(), of()), {"axis": "v", "labels": k}, "labels") for k in (["x", "x"], ["x"], ["x", ""], 3)),
        (lambda: (of(), of(summary={})), {}, "keeps no cells"),
        (lambda: (of(), of(where="height > 1")), {}, "where"),
        (lambda: (of(), of(outputs=["impact_speed"])), {}, "outputs"),
        (lambda: (of(), unfinished()), {}, "unfinished"),
        (lambda: (of(), of_other_sources()), {}, "changed"),
        (lambda: (sweep.join(of(), of([32.0])), of_other_sources()), {}, "changed"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused(results, options, message):
    with pytest.raises(sweep.SweepError, match=message):
        sweep.join(*results(), **options)


@pytest.mark.parametrize(
    ("change", "refused"),
    [
        (lambda ds: ds.isel(height=slice(None, None, -1)), "join"),
        (lambda ds: ds.isel(height=slice(2)), "join"),
        (lambda ds: ds.isel(height=0), "join refine"),
        (lambda ds: ds.rename(height="h"), "join refine check"),
        (lambda ds: ds.expand_dims(run=2), "join"),
        (lambda ds: ds.assign_coords(drop=2.0 * ds.height).swap_dims(height="drop"), "join"),
        (lambda ds: ds.drop_vars("error_bound"), "join refine"),
        (lambda ds: ds.drop_vars("method_used"), "join refine check"),
        (lambda ds: ds.where(ds.height > 1), "join refine check statuses"),
        *((lambda ds, n=n, u=u: sweep.in_units(ds, {n: u}), "join refine check") for n, u in UNITS.items()),
    ],
)
def test_what_is_no_longer_as_it_was_read_is_refused_where_it_would_give_other_numbers(change, refused):
    keys = {"fixed": {"g": 9.0}, "outputs": ["fall_time"]}
    uses = {
        "join": lambda ds: sweep.join(ds, ds, axis="version"),
        "refine": lambda ds: sweep.refine(ds, "fall_time", 0.2, study=build(**AXES, **keys)).dataset,
        "check": lambda ds: ds.sweep.check(allow_import=True),
        "statuses": lambda ds: ds.sweep.statuses(),
    }
    changed = change(sweep.run(build(**AXES, **keys)))
    for name, use in uses.items():
        if name in refused.split():
            with pytest.raises(sweep.SweepError, match=r"as it was read|two values"):
                use(changed)
        else:
            use(changed)
    assert "plot" in repr(changed.sweep)


@pytest.mark.parametrize("what", ["status", "fall_time"])
def test_cells_of_both_that_differ_are_refused(what):
    a, b = of([1.0, 2.0]), of([2.0, 4.0])
    b[what][0, 1] += 1
    with pytest.raises(sweep.SweepError, match="differ"):
        sweep.join(a, b)


def test_results_beyond_the_memory_are_refused(monkeypatch):
    """Both, and what is made of them."""
    a, b = of([1.0, 2.0]), of([4.0, 8.0])
    there = [2 * (a.nbytes + b.nbytes)]
    monkeypatch.setattr("sweep.results.join.memory", lambda: there[0])
    same(sweep.join(a, b), of())
    same(sweep.join(b, a), of())  # values of an axis rise
    there[0] -= 1
    with pytest.raises(sweep.SweepError, match="memory"):
        sweep.join(a, b)


@pytest.mark.parametrize("left", ["a join of other results", "an unfinished run"])
def test_what_is_there_is_replaced_by_force_alone(tmp_path, left):
    """The studies of all three results are the same: some source has changed."""
    a, b, c = of(), of(), of()
    b.fall_time[0] += 1.0
    c.fall_time[0] += 2.0
    path = tmp_path / "j.h5"
    if left == "an unfinished run":
        interrupted(tall(23), path)
    else:
        sweep.join(a, b, path, axis="version").close()
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    with pytest.raises(sweep.SweepError, match="--force"):
        sweep.join(a, c, path, axis="version")
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before
    with sweep.join(a, c, path, axis="version", force=True) as found:
        assert np.array_equal(found.fall_time[1], c.fall_time)
