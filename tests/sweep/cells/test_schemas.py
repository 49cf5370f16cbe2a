"""What a result holds before there is any: columns, coordinates and attributes, of cells and of a summary, by name."""

import json

import numpy as np
import pytest
from toy_studies import build

from kernels.interface import Status
from sweep.cells import schema as module
from sweep.cells.grid import Box
from sweep.cells.output_schema import gathered, output_schema, part_columns
from sweep.cells.partition import row_blocks
from sweep.cells.reduce import nothing
from sweep.cells.schema import Column, Coordinate, Schema, cell_schema, cells_of, columns, coordinates

MARK = {"study": "abc", "numba": "1"}
AXES = {"height": [1.0, 2.0, 4.0], "v0": [0.0, 1.0]}
WORDS = {"v0": [0.0, 1.0], "method": ["rough", "exact", "auto"]}


def full(**keys):
    return build(**{"axes": AXES, "outputs": ["fall_time", "drop"], "along": {"phase": [0.0, 0.5, 1.0]}, **keys})


def by_name(things):
    return {thing.name: thing for thing in things}


def test_sizes_of_a_column_and_of_all():
    x = Column("x", "<f8", ("m", "n"), (2, 3), {})
    assert x.cell_bytes == 48
    assert (x.empty(4).shape, x.empty(4).dtype) == ((4, 2, 3), np.float64)
    s = Column("s", "i1", (), (), {})
    edge = Coordinate("edge", ("w",), np.zeros(7), {})
    found = Schema(Box(("u",), (5,)), (x, s), (edge, Coordinate("u", ("u",), np.zeros(5), {})), {})
    assert found.cell_bytes == 49
    assert found.sizes == {"u": 5, "m": 2, "n": 3, "w": 7}
    assert list(found.sizes) == ["u", "m", "n", "w"]
    assert (found.shape(x), found.shape(s)) == ((5, 2, 3), (5,))


def test_columns_are_the_outputs_in_the_order_of_the_kernel_and_what_is_said_of_them():
    found = columns(full(outputs=["drop", "fall_time"], rtol=1e-5))
    assert [(c.name, c.dtype, c.dims, c.shape) for c in found] == [
        ("fall_time", "f8", (), ()), ("drop", "f8", ("phase",), (3,)),
        ("error_bound", "f4", (), ()), ("status", "i1", (), ()), ("method_used", "i1", (), ()),
    ]  # fmt: skip
    assert found[1].attrs == {
        "units": "m", "long_name": "way fallen", "ancillary_variables": "status method_used error_bound", "rtol": 1e-5,
    }  # fmt: skip
    assert found[2].attrs == {
        "units": "1",
        "long_name": "relative error that INACCURATE values are right to, inf where unknown; NaN where rtol holds",
    }
    assert found[3].attrs["long_name"] == "what became of the cell"
    assert found[3].attrs["flag_values"].tolist() == [int(s) for s in Status]
    assert found[3].attrs["flag_meanings"].split() == [s.name for s in Status]
    assert found[4].attrs["long_name"] == "method that solved the cell"
    assert found[4].attrs["flag_values"].tolist() == [-1, 0, 1]
    assert {found[k].attrs["flag_values"].dtype for k in (3, 4)} == {np.dtype("i1")}
    assert found[4].attrs["flag_meanings"] == "none rough exact"


def test_where_rtol_is_an_axis_no_output_has_one():
    study = full(axes={"height": [1.0], "rtol": [1e-3, 1e-6]})
    assert all("rtol" not in c.attrs for c in columns(study))
    attrs = cell_schema(study, MARK).attrs
    assert "rtol" not in attrs
    assert attrs["method"] == "auto"
    attrs = cell_schema(full(axes={"height": [1.0], "method": ["rough"]}, rtol=1e-4), MARK).attrs
    assert "method" not in attrs
    assert attrs["rtol"] == 1e-4


def test_columns_by_name_are_cells():
    arrays = {"x": np.zeros(2), "status": np.ones(2, "i1"), "method_used": np.zeros(2, "i1")}
    found = cells_of(arrays)
    assert list(found.outputs) == ["x"]
    assert (found.status is arrays["status"], found.used is arrays["method_used"], found.error) == (True, True, None)
    error = np.zeros(2, "f4")
    assert cells_of({**arrays, "error_bound": error}).error is error


def test_coordinates_are_axes_fixed_parameters_and_what_cells_share():
    found = by_name(coordinates(full()))
    assert [(c.name, c.dims) for c in found.values()] == [
        ("height", ("height",)), ("v0", ("v0",)), ("g", ()), ("phase", ("phase",)),
    ]  # fmt: skip
    assert found["height"].attrs == {"units": "m", "long_name": "height above the ground"}
    assert found["g"].values == 9.80665
    assert found["phase"].values.tolist() == [0.0, 0.5, 1.0]
    # what no output that is asked for runs along is left out
    assert "phase" not in by_name(coordinates(full(outputs=["fall_time"])))


def test_axes_of_words_and_settings_are_told():
    found = by_name(coordinates(build(axes={**WORDS, "rtol": [1e-3, 1e-6]}, fixed={"height": 2.0})))
    assert found["method"].values.tolist() == ["rough", "exact", "auto"]
    assert found["method"].attrs == {"long_name": "method asked for"}
    assert found["rtol"].attrs == {"units": "1", "long_name": "relative error asked for"}


def test_a_zip_has_its_axes_along_the_cells():
    found = by_name(coordinates(build(axes=AXES | {"v0": [0.0, 1.0, 2.0]}, design="zip")))
    assert (found["height"].dims, found["v0"].dims) == (("cell",), ("cell",))


def test_arrays_are_numbered_from_one():
    counted = module._counting("mass", 3)
    assert counted.values.tolist() == [1, 2, 3]
    assert (counted.name, counted.dims) == ("mass", ("mass",))
    assert counted.attrs == {"units": "1", "long_name": "number of the mass"}


def test_attributes_suffice_to_run_it_again(monkeypatch):
    monkeypatch.setattr(module, "version", lambda name: f"<{name}>")
    study = full(title="Stones", question="Why?", where="v0 < 0.5", method="exact")
    found = cell_schema(study, MARK).attrs
    assert {name: found[name] for name in ("Conventions", "title", "question", "kernel", "source", "design", "where",
                                           "method", "rtol")} == {
        "Conventions": "CF-1.11", "title": "Stones", "question": "Why?", "kernel": "toy:KERNEL",
        "source": "Newton's second law, integrated twice", "design": "product", "where": "v0 < 0.5",
        "method": "exact", "rtol": 1e-9,
    }  # fmt: skip
    assert json.loads(found["fingerprint"]) == MARK
    assert found["fingerprint"].index("numba") < found["fingerprint"].index("study")
    assert (found["study"], found["study_json"]) == (study.text, study.to_json())
    names = ("foliot", "numba", "llvmlite", "numpy", "xarray", "h5py", "h5netcdf")
    assert found["versions"].split(", ")[:-2] == [f"{name} <{name}>" for name in names]
    assert found["versions"].split(", ")[-2].startswith("python 3.")
    assert "where" not in cell_schema(full(), MARK).attrs


EVERY = {"outputs": {"fall_time": ["min", "max", "mean", "histogram", "argmin"], "drop": ["argmax"]},
         "edges": {"fall_time": [0.4, 0.5, 0.7]}}  # fmt: skip


def summary(over=("v0",), axes=AXES, every=EVERY, **keys):
    return full(axes=axes, summary={**every, "over": list(over)}, **keys)


def test_columns_of_a_summary():
    found = output_schema(summary(), MARK)
    kinds = {c.name: (c.dtype, c.dims, c.shape) for c in found.columns}
    many = len(Status) + 1
    assert list(kinds.items()) == [
        ("fall_time_count", ("i8", (), ())),
        ("fall_time_min", ("f8", (), ())),
        ("fall_time_max", ("f8", (), ())),
        ("fall_time_mean", ("f8", (), ())),
        ("fall_time_argmin_v0", ("f8", (), ())),
        ("fall_time_argmin_status", ("i1", (), ())),
        ("fall_time_below", ("i8", (), ())),
        ("fall_time_above", ("i8", (), ())),
        ("fall_time_histogram", ("i8", ("fall_time_bin",), (2,))),
        ("drop_count", ("i8", ("phase",), (3,))),
        ("drop_argmax_v0", ("f8", ("phase",), (3,))),
        ("drop_argmax_status", ("i1", ("phase",), (3,))),
        ("cells_by_status", ("i8", ("status_name",), (many,))),
        ("cells_by_method", ("i8", ("method_name",), (3,))),
    ]
    assert (found.grid.dims, found.grid.shape) == (("height",), (3,))
    assert found.attrs["over"] == "v0"
    assert output_schema(summary(("v0", "height")), MARK).attrs["over"] == "height v0"
    assert output_schema(summary(("v0", "height")), MARK).grid.shape == ()


def test_what_columns_of_a_summary_say_of_themselves():
    found = {c.name: c.attrs for c in output_schema(summary(("v0", "height")), MARK).columns}
    doc = "time until the ground is reached"
    assert found["fall_time_count"] == {"units": "1", "long_name": f"cells with a value: {doc}"}
    for name, word in (("min", "minimum"), ("max", "maximum"), ("mean", "mean")):
        assert found[f"fall_time_{name}"] == {
            "units": "s", "long_name": f"{name} of {doc}", "cell_methods": f"height: v0: {word}"
        }  # fmt: skip
    assert found["fall_time_below"] == {"units": "1", "long_name": f"cells below the first bin: {doc}"}
    assert found["fall_time_above"] == {"units": "1", "long_name": f"cells above the last bin: {doc}"}
    assert found["fall_time_histogram"] == {"units": "1", "long_name": f"cells in each bin: {doc}"}
    assert found["fall_time_argmin_v0"] == {"long_name": f"v0 at the min of {doc}", "units": "m/s"}
    status = found["fall_time_argmin_status"]
    assert status["long_name"] == f"status of the cell at the min of {doc}"
    assert status["flag_meanings"].split() == [s.name for s in Status]
    assert found["cells_by_status"] == {"units": "1", "long_name": "cells of each status"}
    assert found["cells_by_method"] == {"units": "1", "long_name": "cells that each method solved"}


def test_the_place_of_an_extreme_on_axes_of_words_and_of_settings():
    every = {"outputs": {"fall_time": ["argmin"]}}
    study = build(axes={**WORDS, "rtol": [1e-3, 1e-6]}, fixed={"height": 2.0},
                  summary={**every, "over": ["method", "rtol"]})  # fmt: skip
    found = by_name(output_schema(study, MARK).columns)
    word = found["fall_time_argmin_method"]
    assert word.dtype == "i8"
    assert word.attrs["flag_values"].tolist() == [-1, 0, 1, 2]
    assert word.attrs["flag_meanings"] == "none rough exact auto"
    assert (found["fall_time_argmin_rtol"].dtype, found["fall_time_argmin_rtol"].attrs["units"]) == ("f8", "1")


def test_coordinates_of_a_summary_name_statuses_methods_and_bins():
    found = by_name(output_schema(summary(), MARK).coordinates)
    assert set(found) >= {"height", "v0", "g", "phase"}
    assert found["method_name"].values.tolist() == ["none", "rough", "exact"]
    assert found["method_name"].attrs == {"long_name": "method that solved a cell"}
    assert found["status_name"].attrs == {"long_name": "what became of a cell"}
    assert found["status_name"].values[0] == "OK"
    lower, upper = found["fall_time_bin_lower"], found["fall_time_bin_upper"]
    assert (lower.dims, lower.values.tolist(), upper.values.tolist()) == (("fall_time_bin",), [0.4, 0.5], [0.5, 0.7])
    assert lower.attrs == {"units": "s", "long_name": "lower edge of a bin"}
    assert upper.attrs["long_name"] == "upper edge of a bin"


def test_parts_of_cells_are_cells_and_those_of_a_summary_rows():
    assert [c.name for c in part_columns(full())] == [c.name for c in columns(full())]
    assert "fall_time min" in [c.name for c in part_columns(summary())]


def rows_of(study):
    """Rows of nothing, to be filled in by hand."""
    return nothing(study, row_blocks(study).count)


@pytest.mark.parametrize("over", [("v0",), ("height",)])
def test_groups_are_gathered_of_their_rows(over):
    """Rows of a few cells are one cell each; groups follow each other."""
    study = summary(over, axes={"v0": [0.0, 1.0, 2.0], "height": [1.0, 2.0, 4.0, 8.0, 16.0, 32.0]})
    rows, blocks = rows_of(study), row_blocks(study)
    per, groups = blocks.per_group, blocks.groups
    assert (groups, blocks.group) == ((6, 3) if over == ("v0",) else (3, 6))
    values = np.arange(1.0, blocks.count + 1)[::-1].copy()
    rows["fall_time count"][:] = 2
    for name in ("min", "max", "sum"):
        rows[f"fall_time {name}"][:] = values
    rows["fall_time rest"][:] = 0.25
    rows["fall_time min at"][:] = blocks.first(np.arange(blocks.count))
    rows["fall_time min status"][:] = Status.INACCURATE
    rows["fall_time histogram"][:] = [1, 2, 3, 4]
    rows["cells_by_method"][:, 1] = 5
    found = gathered(study, rows)
    by_group = values.reshape(groups, per)
    assert found["fall_time_count"].tolist() == [2 * per] * groups
    np.testing.assert_array_equal(found["fall_time_min"], by_group.min(axis=1))
    np.testing.assert_array_equal(found["fall_time_max"], by_group.max(axis=1))
    np.testing.assert_allclose(found["fall_time_mean"], (by_group.sum(axis=1) + 0.25 * per) / (2 * per), rtol=1e-15)
    assert found["fall_time_below"].tolist() == [per] * groups
    assert found["fall_time_histogram"].tolist() == [[2 * per, 3 * per]] * groups
    assert found["fall_time_above"].tolist() == [4 * per] * groups
    assert found["cells_by_method"][:, 1].tolist() == [5 * per] * groups
    last = blocks.first(np.arange(1, groups + 1) * per - 1)
    axis = study.axes[over[0]].values
    np.testing.assert_array_equal(found[f"fall_time_argmin_{over[0]}"], axis[last // study.run(over[0]) % len(axis)])
    assert (found["fall_time_argmin_status"] == Status.INACCURATE).all()


def test_of_no_cell_there_is_no_extreme_no_mean_and_no_place():
    study = summary()
    found = gathered(study, rows_of(study))
    for name in ("fall_time_min", "fall_time_max", "fall_time_mean", "fall_time_argmin_v0"):
        assert np.isnan(found[name]).all(), name
    assert np.isnan(found["drop_argmax_v0"]).all()
    assert (found["fall_time_argmin_status"] == Status.PENDING).all()
    assert found["fall_time_argmin_status"].dtype == np.int8
    every = {"outputs": {"fall_time": ["argmin"]}}
    words = build(axes=WORDS, fixed={"height": 2.0}, summary={**every, "over": ["method"]})
    rows = rows_of(words)
    assert gathered(words, rows)["fall_time_argmin_method"].tolist() == [-1, -1]
    rows["fall_time count"][:] = 1
    rows["fall_time min"][:] = np.linspace(2.0, 1.0, len(rows["fall_time min"]))
    rows["fall_time min at"][:] = row_blocks(words).first(np.arange(len(rows["fall_time min"])))
    at = row_blocks(words).first(np.arange(1, 3) * row_blocks(words).per_group - 1)
    assert gathered(words, rows)["fall_time_argmin_method"].tolist() == (at % 3).tolist()


def test_a_sum_that_overflows_has_no_warning():
    study = summary()
    rows = rows_of(study)
    rows["fall_time count"][:] = 1
    rows["fall_time sum"][:], rows["fall_time rest"][:] = np.inf, -np.inf
    assert np.isnan(gathered(study, rows)["fall_time_mean"]).all()
