"""What is no Dataset, no study and no path is told by name, with the way to what is."""

from pathlib import Path

import pytest
from toy_studies import build

import sweep

OF_A_DATASET = {
    "export": ("a.csv",),
    "where": ("height > 1",),
    "in_units": ({"height": "mm"},),
    "study_of": (),
    "plot": (),
    "plot_precision": (),
    "plot_laws": (),
}


def refusal(function, *given):
    with pytest.raises(sweep.SweepError) as caught:
        function(*given)
    return str(caught.value)


@pytest.fixture(scope="module")
def result():
    return sweep.run(build(axes={"height": [1.0, 2.0]}))


@pytest.mark.parametrize("name", OF_A_DATASET)
def test_what_is_no_dataset_is_told(name, result):
    for given in (3, None, "a.h5", result.fall_time):
        message = refusal(getattr(sweep, name), given, *OF_A_DATASET[name])
        assert message.startswith("expected a Dataset from ")
        assert f"; found a {type(given).__name__}" in message


def test_the_way_to_a_dataset_is_told(result):
    assert 'open the file first: sweep.open_result("a.h5")' in refusal(sweep.plot, Path("a.h5"))
    assert "sweep.run(study)" in refusal(sweep.plot, sweep.study_of(result, allow_import=True))
    assert "from compare_laws; found a int" in refusal(sweep.plot_laws, 3)
    assert "from work_precision; this one has no error_median" in refusal(sweep.plot_precision, result)
    assert "from compare_laws; this one has no worse" in refusal(sweep.plot_laws, result)


def test_a_result_is_no_study(result):
    for function in (sweep.run, sweep.study, sweep.plan):
        assert "found a Dataset; sweep.study_of(dataset)" in refusal(function, result)


def test_what_is_no_study_has_no_text(result):
    assert "found a Dataset" in refusal(sweep.to_toml, result)
    assert "expected a study, e.g. sweep.study_of(ds); found a int" in refusal(sweep.to_toml, 3)


def test_what_names_no_file_is_told():
    assert "expected a path" in refusal(sweep.read_study, 3)
