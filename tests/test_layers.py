"""What the packages are, and what importing them costs."""

import subprocess
import sys
from pathlib import Path

import pytest

import kernels
import sweep

ROOT = Path(__file__).parent.parent


def loaded(code):
    """Top-level modules loaded after running `code` in a fresh interpreter."""
    script = f"{code}\nimport sys; print(*sorted({{m.partition('.')[0] for m in sys.modules}}))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, cwd=ROOT)
    return set(done.stdout.splitlines()[-1].split())


def test_the_packages_tested_are_this_checkout():
    for package in (kernels, sweep):
        assert Path(package.__file__).is_relative_to(ROOT)


@pytest.mark.parametrize(
    "code",
    [
        "import sweep",
        "import sweep.cli",
        "import contextlib, sweep.cli\nwith contextlib.suppress(SystemExit): sweep.cli.main(['--help'])",
    ],
)
def test_help_is_there_at_once(code):
    assert loaded(code).isdisjoint({"numba", "xarray", "pint", "numpy", "h5py", "dask", "matplotlib"})


def test_the_contract_needs_no_compiler():
    assert "numba" not in loaded("import kernels.interface, kernels.catalogue")


def test_a_study_without_foreign_units_does_without_pint():
    assert "pint" not in loaded(
        "import sweep\nsweep.build_study(kernel='foliot', axes={'mu': [1.0]}, fixed={'a': 1.0, 'phi0': 1.0})"
    )


def test_a_small_run_to_a_file_needs_neither_xarray_nor_pandas(tmp_path):
    """What says how it ended is read from the file; their import takes longer than all else of a small run."""
    (tmp_path / "study.toml").write_text(
        'kernel = "foliot"\n[axes]\nmu = [1.0, 2.0, nan]\n[fixed]\na = 1.0\nphi0 = { value = 60, unit = "degree" }\n'
    )
    told = loaded(
        f"import sweep.cli\nassert sweep.cli.main(['run', r'{tmp_path}/study.toml', '-o', r'{tmp_path}/out.h5']) == 0"
    )
    assert told.isdisjoint({"xarray", "pandas", "pint", "dask"})
    assert (tmp_path / "out.h5").exists()
