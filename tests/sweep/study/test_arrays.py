"""Array parameters: lists in [fixed], csv files, axes of a zip, and what becomes of them in a result."""

import h5py
import numpy as np
import pytest
import xarray as xr

import sweep
from sweep.cells.fingerprint import difference, fingerprint
from sweep.show.text import result_text
from sweep.study.model import Study
from sweep.system.errors import StudyError

MASS = [0.1, 0.2, 0.7]


def beads(fixed=None, **keys):
    given = {"fixed": {"mass": MASS} if fixed is None else fixed, "axes": {"g": [1.0, 2.0]}} | keys
    return sweep.study(kernel="beads:KERNEL", allow_import=True, **given)


def mistakes(**keys):
    with pytest.raises(StudyError) as caught:
        beads(**keys)
    return str(caught.value)


def test_a_list_and_one_number_for_all():
    ds = sweep.run(beads())
    assert ds.moment.dims == ("g", "bead")
    assert ds.share.dims == ("g", "turned")
    np.testing.assert_allclose(ds.moment, np.outer([1.0, 2.0], MASS) * 0.5)
    np.testing.assert_allclose(ds.share[0], MASS[::-1])
    assert ds.place.dims == ("bead",)
    assert ds.bead.values.tolist() == [1, 2, 3]


def test_units_are_converted_value_by_value():
    study = beads({"mass": {"value": [100, 200, 700], "unit": "g"}, "place": {"value": 30, "unit": "mm"}})
    assert study.fixed["mass"].tolist() == MASS
    assert study.fixed["place"].tolist() == [0.03] * 3


def test_arrays_from_columns_of_a_csv_file(tmp_path):
    (tmp_path / "rod.csv").write_text("mass,place\n100,1\n200,2\n700,3\n")
    (tmp_path / "study.toml").write_text(
        'kernel = "beads:KERNEL"\n[axes]\ng = [1.0]\n[fixed]\n'
        'mass = { file = "rod.csv", unit = "g" }\nplace = { file = "rod.csv" }\n'
    )
    study = sweep.study(tmp_path / "study.toml", allow_import=True)
    assert study.fixed["mass"].tolist() == MASS
    assert study.fixed["place"].tolist() == [1.0, 2.0, 3.0]


def test_rows_of_a_zip_axis_and_numbered_columns_of_a_file(tmp_path):
    rows = [[1.0, 2.0], [3.0, 4.0], [5.0, 7.0]]
    study = beads({}, axes={"mass": rows, "g": [1.0, 2.0, 3.0]}, design="zip")
    ds = sweep.run(study)
    assert ds.total.values.tolist() == [3.0, 7.0, 12.0]
    assert ds.mass.dims == ("cell", "bead")
    np.testing.assert_allclose(ds.moment, 0.5 * np.array(rows) * [[1.0], [2.0], [3.0]])
    (tmp_path / "rows.csv").write_text("mass_1,mass_2\n1,2\n3,4\n5,7\n")
    (tmp_path / "study.toml").write_text(
        'kernel = "beads:KERNEL"\ndesign = "zip"\n[axes.mass]\nfile = "rows.csv"\n[axes]\ng = [1.0, 2.0, 3.0]\n'
    )
    read = sweep.study(tmp_path / "study.toml", allow_import=True)
    np.testing.assert_array_equal(read.axes["mass"].values, rows)


@pytest.mark.parametrize("length", [3, 2000])
def test_a_study_of_arrays_survives_its_json(length):
    mass = np.linspace(1.0, 2.0, length)
    for study in (
        beads({"mass": mass}),
        beads({}, axes={"mass": [mass.tolist(), (2 * mass).tolist()]}, design="zip"),
    ):
        again = Study.from_json(study.to_json(), allow_import=True)
        assert again == study
        assert again.lengths == study.lengths == {"bead": length, "turned": length}
        assert Study.from_json(study.to_json(), declared=True).lengths == study.lengths


def test_the_file_opens_with_plain_readers_and_equals_the_run_in_memory(tmp_path):
    for number, study in enumerate((beads(), beads({}, axes={"mass": [[1.0, 2.0], [3.0, 4.0]]}, design="zip"))):
        path = tmp_path / f"{number}.h5"
        ds = sweep.run(study, path)
        with xr.open_dataset(path, engine="h5netcdf") as plain:
            assert {"mass", "place", "bead", "turned"} <= set(plain.coords)
            xr.testing.assert_equal(plain.load().drop_vars("g"), sweep.run(study).drop_vars("g"))
        with xr.open_dataset(path, engine="netcdf4") as plain:
            assert "mass" in plain.coords
        with h5py.File(path) as file:
            np.testing.assert_array_equal(file["moment"][:], ds.moment)
        shown = result_text(path, sweep.open_result(path))
        assert ("(0.1, 0.2, 0.7)" if number == 0 else "(1, 2) to (3, 4)") in shown


def test_another_array_is_another_study():
    found = difference(fingerprint(beads()), fingerprint(beads({"mass": [0.1, 0.2, 0.8]})))
    assert any("fixed.mass" in str(line) for line in found)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"fixed": {}}, "fixed.mass"),
        ({"fixed": {"mass": 1.0}}, "how many of bead"),
        ({"fixed": {"mass": MASS, "place": [1.0, 2.0]}}, "mass has 3 and place has 2"),
        ({"fixed": {"mass": ["a", 2.0]}}, "fixed.mass[0]"),
        ({"fixed": {"mass": []}}, "has no values"),
        ({"fixed": {"mass": {"value": MASS, "unit": "m"}}}, "is a length"),
        ({"fixed": {"mass": {"file": "none.csv"}}}, "none.csv"),
        ({"fixed": {}, "axes": {"mass": [MASS, MASS]}}, 'design = "zip"'),
        ({"fixed": {}, "axes": {"mass": [MASS, MASS[:2]]}, "design": "zip"}, "equal length"),
        ({"fixed": {}, "axes": {"mass": [1.0, 2.0]}, "design": "zip"}, "list of lists"),
        ({"fixed": {}, "axes": {"mass": {"spacing": "log", "start": 1, "stop": 2, "num": 3}}}, "give values or a file"),
        ({"method": "quick"}, "quick does not give share; use auto or whole"),
    ],
)
def test_mistakes_are_told(keys, message):
    assert message in mistakes(**keys)


def test_a_method_is_kept_out_where_it_lacks_an_output():
    assert set(sweep.run(beads()).method_used.values) == {1}
    assert set(sweep.run(beads(outputs=["total"])).method_used.values) == {0}
    assert sweep.run(beads(outputs=["total"], method="quick")).total[0] == sum(MASS)
