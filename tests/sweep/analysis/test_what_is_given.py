"""What is no output, no result and no study is refused with one clear sentence."""

import numpy as np
import pytest
import xarray as xr

import sweep
from sweep.system.errors import SweepError
from sweep.system.expected import kind

X = np.geomspace(1, 100, 12)
LINE = xr.DataArray(X**-0.5, {"x": X}, "x", name="y")
FIT = {"wrong": 3}

OF_AN_OUTPUT = {
    "fit_exponent": lambda y: sweep.fit_exponent(y, "x"),
    "fit_two_laws": lambda y: sweep.fit_two_laws(y, "x"),
    "fit_correction": lambda y: sweep.fit_correction(y, "x"),
    "exponent_by_window": lambda y: sweep.fit_exponent(y, "x", towards="high"),
    "compare_laws": lambda y: sweep.compare_laws(y, "x"),
    "local_exponent": lambda y: sweep.local_exponent(y, "x"),
    "local_exponent_error": lambda y: sweep.local_exponent(y, "x", error=True).exponent_error,
    "where_value": lambda y: sweep.where_exponent(y, "x", 1.0, values=True),
    "where_exponent": lambda y: sweep.where_exponent(y, "x", -0.5),
    "exponent_map": lambda y: sweep.exponent_map(y, "x"),
    "fit_collapse": lambda y: sweep.fit_collapse(y, "x", "L"),
}
OF_A_DATASET = {
    "interpolated": lambda ds: sweep.interpolated(ds, {"x": [1.0]}),
    "refine": lambda ds: sweep.refine(ds, "y", 0.1),
}


@pytest.mark.parametrize("given", [3, None, "period", X, LINE.to_dataset(), [1.0, 2.0]], ids=lambda g: type(g).__name__)
@pytest.mark.parametrize("name", OF_AN_OUTPUT)
def test_what_is_no_output_is_refused(name, given):
    with pytest.raises(SweepError, match=f"expected one output, e.g. ds.period; found {kind(given)}"):
        OF_AN_OUTPUT[name](given)


@pytest.mark.parametrize("values", [LINE.astype(str), LINE.astype(complex)], ids=["words", "complex"])
@pytest.mark.parametrize("name", OF_AN_OUTPUT)
def test_an_output_of_words_or_complex_numbers_is_refused(name, values):
    with pytest.raises(SweepError, match="y: expected real numbers, found"):
        OF_AN_OUTPUT[name](values)


@pytest.mark.parametrize("given", [3, None, "result.h5", LINE, FIT], ids=lambda g: type(g).__name__)
@pytest.mark.parametrize("name", OF_A_DATASET)
def test_what_is_no_dataset_is_refused(name, given):
    with pytest.raises(SweepError, match=f"expected a Dataset, found {kind(given)}"):
        OF_A_DATASET[name](given)


def test_a_bound_of_a_result_without_the_output_is_refused():
    with pytest.raises(SweepError, match="this Dataset has no "):
        sweep.fit_exponent(LINE, "x", bound=LINE.rename("other").to_dataset())


@pytest.mark.parametrize("given", [None, 3, "study.toml", LINE.to_dataset()])
def test_what_is_no_study_has_no_groups(given):
    with pytest.raises(SweepError, match="study"):
        sweep.scaling(given)


@pytest.mark.parametrize("sigma", [0.0, 1e-20, 1e9, LINE * 0])
@pytest.mark.parametrize("function", [sweep.fit_exponent, sweep.compare_laws])
def test_standard_errors_of_nothing_or_beyond_all_sense_are_refused(function, sigma):
    with pytest.raises(SweepError, match=r"sigma: expected standard errors of 2.2e-16 to 1e\+06 times y, found"):
        function(LINE, "x", sigma=sigma)
