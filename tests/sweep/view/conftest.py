"""A result of three axes, with cells that are refused."""

import pytest

import sweep


@pytest.fixture(scope="session")
def result(tmp_path_factory):
    path = tmp_path_factory.mktemp("view") / "map.h5"
    study = sweep.study(
        kernel="foliot",
        outputs=["period", "amplitude"],
        axes={
            "mu": {"spacing": "log", "start": 1e-2, "stop": 1e2, "num": 41},
            "R": {"spacing": "linear", "start": 0.0, "stop": 2.0, "num": 21},
            "a": {"values": [0.5, 1.0, 2.0]},
        },
        fixed={"phi0": 1.0},
        title="A map of three axes",
    )
    sweep.run(study, path, progress=False).close()
    return path


@pytest.fixture
def dataset(result):
    with sweep.open_result(result) as found:
        yield found
