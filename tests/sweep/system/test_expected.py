"""What is no Dataset, no study and no path is told by name, with the way to what is."""

from pathlib import Path

import pytest
from toy_studies import build

import sweep

OF_A_DATASET = {
    "export": ("a.csv",),
    "where": ("height > 1",),
    "in_units": ({"height": "mm"},),
    "plot": (),
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
    for given, found in {3: "an int", None: "nothing", "a.h5": "a str"}.items():
        message = refusal(getattr(sweep, name), given, *OF_A_DATASET[name])
        assert message.startswith(f"sweep.{name}: expected a Dataset, found {found};")
    assert "found a DataArray" in refusal(getattr(sweep, name), result.fall_time, *OF_A_DATASET[name])


def test_the_way_to_a_dataset_is_told(result):
    assert 'sweep.open_result("a.h5")' in refusal(sweep.plot, Path("a.h5"))
    assert "sweep.run(study)" in refusal(sweep.plot, sweep.study(result, allow_import=True))


def test_a_result_says_which_study_it_came_from(result):
    assert sweep.study(result, allow_import=True).title == result.attrs["title"]
    assert "pass the study" in refusal(sweep.study, result.drop_attrs())


def test_what_is_no_study_has_no_text(result):
    assert "expected a Study, found a Dataset" in refusal(sweep.to_toml, result)
    assert "expected a Study, found an int" in refusal(sweep.to_toml, 3)


def test_what_names_no_file_is_told():
    assert "its path" in refusal(sweep.study, 3)
