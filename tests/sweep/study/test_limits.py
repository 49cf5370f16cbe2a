"""Thresholds of a study from both sides: how many points and cells, which seeds, edges and names of a summary."""

from dataclasses import replace

import numpy as np
import pytest
import toy
from columns import columns_of
from toy_studies import build

import sweep
from kernels import catalogue
from kernels.interface import FIRST_REFUSAL, Field, Status
from sweep.study import samples
from sweep.study.kernel_lookup import load_kernel


def told(**keys):
    """{where: message} of what is wrong."""
    try:
        build(**keys)
    except sweep.StudyError as error:
        return {m.where: m.message for m in error.mistakes}
    return {}


@pytest.mark.parametrize(
    ("edges", "message"),
    [
        ([1.0, 2.0], None),
        ([1.0], "expected at least 2 edges, found 1"),
        ([1.0, 1.0], "expected finite edges, each larger than the one before"),
        ([2.0, 1.0], "expected finite edges, each larger than the one before"),
        ([1.0, np.inf], "expected finite edges, each larger than the one before"),
    ],
)
def test_edges_of_a_histogram_rise(edges, message):
    summary = {"outputs": {"fall_time": ["histogram"]}, "edges": {"fall_time": edges}}
    found = told(axes={"height": [1.0]}, summary=summary)
    assert found == ({} if message is None else {"summary.edges.fall_time": message})


def test_a_summary_reduces_all_axes_and_outputs_in_order_unless_told_otherwise():
    axes = {"height": [1.0, 2.0], "v0": [0.0, 1.0], "g": [1.0, 2.0]}
    found = build(axes=axes, summary={}).summary
    assert found.over == ("height", "v0", "g")
    assert found.outputs == {"fall_time": ("min", "max", "mean", "argmin", "argmax")}
    some = build(axes=axes, summary={"over": ["g", "height"], "outputs": {"fall_time": ["argmax", "min"]}}).summary
    assert (some.over, some.outputs) == (("height", "g"), {"fall_time": ("min", "argmax")})
    assert told(axes=axes, summary={"outputs": {"fal_time": ["min"]}}) == {
        "summary.outputs.fal_time": "is none of the outputs asked for; did you mean fall_time?"
    }


def test_blocks_have_values_of_their_own_shape():
    assert samples.GENERATORS.keys() == {"sobol", "latin", "random", "saltelli", "morris"}
    found = told(blocks=[{"axes": {"height": [1.0, 1.0]}}, {"axes": {"v0": [0.0, 0.0]}, "design": "zip"}])
    assert found == {"blocks[0].axes.height": "1 stands more than once; give every value once"}


def refused(monkeypatch, **changes):
    """What is said of a kernel that declares these."""
    monkeypatch.setattr(toy, "KERNEL", replace(toy.KERNEL, **changes))
    with pytest.raises(sweep.SweepError) as caught:
        load_kernel("toy:KERNEL", True)
    return str(caught.value)


@pytest.mark.parametrize("name", ["status", "method_used", "error_bound", "method", "rtol", "cell", "height", "phase"])
def test_a_kernel_declares_each_name_once_and_none_of_the_results_own(monkeypatch, name):
    found = refused(monkeypatch, outputs=(Field(name, "s", ""),))
    assert found == f"kernel toy:KERNEL declares {name} more than once, or takes a name of the result's own"


def test_an_output_runs_along_what_there_is(monkeypatch):
    found = refused(monkeypatch, outputs=(*toy.KERNEL.outputs, Field("trace", "s", "", dims=("place",))))
    assert found == "kernel toy:KERNEL has outputs along place, neither in `along` nor a dim of array parameters"


def _reached(field, value, columns):
    """Columns of one cell with the value in place of the parameter's; of an array, in each of its places."""
    for j in range(columns[field.name].shape[-1]):
        changed = columns[field.name].copy()
        changed[..., j] = value
        yield columns | {field.name: changed}


def _edges(field):
    low, high = field.lower, field.upper
    return {low, high, 0.0, -1.0, 1.0, 2.5, -np.inf, np.nextafter(low, -np.inf), np.nextafter(high, np.inf)}


@pytest.mark.parametrize("name", sorted(catalogue.KERNELS))
def test_what_runs_as_an_axis_is_not_refused_under_fixed(name):
    """As the free end of a drivetrain was: its last spring may be 0."""
    kernel = catalogue.get(name)
    columns = dict(zip([p.name for p in kernel.parameters], columns_of(kernel, (), dict(kernel.example)), strict=True))
    columns = {p: v.reshape(1, -1) for p, v in columns.items()}
    for field in (p for p in kernel.parameters if not p.choices):
        for cell in (cell for value in _edges(field) for cell in _reached(field, value, columns)):
            given = [v if p.dims else v[0] for p, v in zip(kernel.parameters, cell.values(), strict=True)]
            kernel.check(*given, status := np.zeros(1, np.int8))
            if status[0] < FIRST_REFUSAL:
                value = cell[field.name][0].tolist()
                where = told(kernel=name, fixed={field.name: value if field.dims else value[0]})
                assert f"fixed.{field.name}" not in where, where


def test_a_free_end_is_alike_however_it_is_given(tmp_path):
    k = [2.0, 1.0, 0.0]
    (tmp_path / "k.csv").write_text("k\n2\n1\n0\n")
    (tmp_path / "row.csv").write_text("k_1,k_2,k_3\n2,1,0\n")
    keys = {"kernel": "drivetrain", "outputs": ["frequency"], "progress": False}
    fixed, rtol = {"J": [1.0, 1.0, 1.0]}, {"rtol": [1e-9]}
    found = [
        sweep.run(**keys, fixed=fixed | {"k": k}, axes=rtol),
        sweep.run(**keys, fixed=fixed | {"k": {"file": tmp_path / "k.csv"}}, axes=rtol),
        sweep.run(**keys, fixed=fixed, axes={"k": [k], **rtol}, design="zip"),
        sweep.run(**keys, fixed=fixed, axes={"k": {"file": tmp_path / "row.csv"}, **rtol}, design="zip"),
    ]
    for ds in found:
        assert ds.status.values.tolist() == [Status.OK]
        np.testing.assert_array_equal(ds.frequency, found[0].frequency.values)
    assert found[0].frequency[0, 0] == 0.0
