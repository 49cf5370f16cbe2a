"""Every format of `export`: what is read back has every bit, unit, status and attribute of any small Dataset."""

import csv
import itertools

import h5py
import numpy as np
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

import sweep

FLAGS = {"flag_values": np.array([0, 1, 64, 127], np.int8), "flag_meanings": "OK INACCURATE BAD_INPUT PENDING"}
WORDS = dict(zip(FLAGS["flag_values"].tolist(), FLAGS["flag_meanings"].split(), strict=True))
NUMBERS = st.floats(width=64) | st.sampled_from([0.1, -0.0, 5e-324, 1e300, np.nextafter(1.0, 2.0), np.nan, np.inf])
TEXTS = st.text(st.characters(categories=["L", "N", "P", "Zs"]), min_size=1, max_size=12).map(str.strip)
UNITS = st.sampled_from(["s", "rad/s^2", "1", "kg m^2"])
NAMES = st.sampled_from(["=cmd", "plain", "a, b", 'the "longest"', "1_0", "é"])


@st.composite
def datasets(draw):
    """Cells along one to three axes, one of them maybe of words; a trace; statuses; fixed numbers and attributes.

    Dimensions have any order, and a file that it was read from may have been packed.
    """
    sizes = draw(st.lists(st.integers(1, 4), min_size=1, max_size=3))
    axes = [f"axis{k}" for k in range(len(sizes))]
    shape = tuple(sizes)

    def of(dims, numbers):
        values = draw(st.lists(numbers, min_size=int(np.prod(dims)), max_size=int(np.prod(dims))))
        return np.array(values).reshape(dims)

    coords = {n: (n, np.sort(draw(st.lists(st.floats(0.5, 1e9), min_size=s, max_size=s, unique=True)))) for n, s in
              zip(axes, sizes, strict=True)}  # fmt: skip
    ds = xr.Dataset(
        {
            "period": (axes, of(shape, NUMBERS), {"units": draw(UNITS), "long_name": draw(TEXTS)}),
            "trace": ([*axes, "phase"], of((*shape, 2), NUMBERS), {"units": draw(UNITS)}),
            "error_bound": (axes, of(shape, st.floats(width=32, allow_nan=False)).astype(np.float32)),
            "status": (axes, of(shape, st.sampled_from(list(WORDS))).astype(np.int8), FLAGS),
        },
        coords={**coords, "phase": [0.0, 0.5], "phi0": draw(st.floats(0.1, 1.0))},
        attrs={"title": draw(TEXTS), "rtol": 1e-9, "study": '# Why?\nkernel = "foliot"\n'},
    )
    if draw(st.booleans()):
        ds = ds.assign_coords({axes[0]: draw(st.lists(NAMES, min_size=sizes[0], max_size=sizes[0], unique=True))})
    for name in ("period", "trace"):
        ds[name] = ds[name].transpose(*draw(st.permutations(ds[name].dims)))
    ds.period.encoding = draw(st.sampled_from([{}, {"dtype": "float32", "scale_factor": 2.0}]))
    return ds.assign_coords({n: ds[n].assign_attrs(units="m") for n in axes if ds[n].dtype.kind == "f"})


def same(back, ds):
    """Bits, units, dimensions and attributes."""
    assert set(back.variables) == set(ds.variables)
    for name, variable in ds.variables.items():
        found = back[name]
        assert found.dims == variable.dims
        if variable.dtype.kind == "f":
            assert found.dtype == variable.dtype
            nan = np.isnan(variable.values)
            assert np.array_equal(np.isnan(found.values), nan)
            assert found.values[~nan].tobytes() == variable.values[~nan].tobytes()
        else:
            assert found.values.tolist() == variable.values.tolist()
        for key, value in variable.attrs.items():
            assert np.array_equal(found.attrs[key], value), (name, key)
    assert {k: v for k, v in back.attrs.items() if k != "history"} == ds.attrs


@settings(max_examples=25)
@given(ds=datasets(), suffix=st.sampled_from([".nc", ".zarr"]), compress=st.booleans(), large=st.booleans())
def test_a_dataset_comes_back_from_netcdf_and_zarr(tmp_path_factory, ds, suffix, compress, large):
    """Sets of any shape, of which zarr writes each as a folder of files: three seconds in all."""
    ds = ds.chunk(axis0=1) if large else ds
    path = sweep.export(ds, tmp_path_factory.mktemp("out") / f"out{suffix}", compress=compress)
    with xr.open_dataset(path, mask_and_scale=False, engine="h5netcdf" if suffix == ".nc" else "zarr") as back:
        same(back.load(), ds.load())
        assert back.attrs["history"] == "exported by foliot"
        assert back.status.dtype == np.int8
    if suffix == ".nc":
        with h5py.File(path) as file:
            assert "_FillValue" not in file["period"].attrs
            assert "_FillValue" not in file["status"].attrs


def rows_of(ds):
    """What a table has: {name: values, one for each cell and place of a trace}."""
    dims = [*ds.status.dims, "phase"]
    sizes = [range(ds.sizes[dim]) for dim in dims]
    columns = {str(name): [] for name in (*ds.coords, *ds.data_vars)}
    for places in itertools.product(*sizes):
        at = dict(zip(dims, places, strict=True))
        for name, column in columns.items():
            value = ds[name].isel({dim: at[dim] for dim in ds[name].dims}).values[()]
            column.append(WORDS[value] if name == "status" else value)
    return columns


def alike(found, value):
    """The same bits, or the same word; a word that a table would take for a formula has an apostrophe.

    A number of single precision has no more digits than that.
    """
    if isinstance(value, np.float32):
        return found == str(value)
    if isinstance(value, float):
        return np.float64(found).tobytes() == np.float64(value).tobytes() or (
            np.isnan(value) and np.isnan(float(found))
        )
    return found in (value, f"'{value}") and found[:1] not in "=+-@"


@settings(max_examples=25)
@given(ds=datasets())
def test_a_dataset_comes_back_from_tables_of_text_and_of_types(tmp_path_factory, ds):
    import pyarrow.parquet as pq

    folder = tmp_path_factory.mktemp("out")
    expected = rows_of(ds)
    path = sweep.export(ds, folder / "OUT.CSV")
    lines = path.read_text(encoding="utf-8").splitlines()
    with path.open(newline="", encoding="utf-8") as file:
        heading, *rows = csv.reader(line for line in file if not line.startswith("#"))
    assert heading == list(expected)
    for name, column in zip(heading, zip(*rows, strict=True), strict=True):
        assert all(alike(found, value) for found, value in zip(column, expected[name], strict=True)), name
    assert any(line.startswith(f"# period [{ds.period.units}]") for line in lines)
    table = pq.read_table(sweep.export(ds, folder / "out.parquet"))
    for name, column in expected.items():
        for found, value in zip(table[name].to_pylist(), column, strict=True):
            assert alike(found, value) or found == value, name
    for name in ("period", "trace"):
        assert table.schema.field(name).metadata[b"units"].decode() == ds[name].units
    assert table.schema.metadata[b"study"].decode() == ds.attrs["study"]
