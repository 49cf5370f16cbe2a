"""What is overwritten by force, and what never."""

import errno
import os
import shutil
from pathlib import Path

import pytest
from toy_studies import HEAD

import sweep
from sweep.errors import SweepError
from sweep.file import disk

STUDY = HEAD + 'axes.height = { spacing = "log", start = 1, stop = 1000, num = 9 }\n'
KINDS = {
    "a.csv": ("export", "r.h5", "-o", "a.csv"),
    "a.nc": ("export", "r.h5", "-o", "a.nc"),
    "a.parquet": ("export", "r.h5", "-o", "a.parquet"),
    "a.zarr": ("export", "r.h5", "-o", "a.zarr"),
    "laws.csv": ("fit", "r.h5", "--y", "fall_time", "--x", "height", "-o", "laws.csv"),
    "a.png": ("plot", "r.h5", "-o", "a.png"),
    "a.svg": ("plot", "r.h5", "-o", "a.svg"),
    "a.pdf": ("plot", "r.h5", "-o", "a.pdf"),
    "a.html": ("report", "r.h5", "-o", "a.html"),
    "chart.png": ("chart", "s.toml", "--allow-import", "--rtol", "1e-3", "--cells", "4", "-o", "chart.png"),
}
"""What every command writes, and how it is called."""


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    folder = tmp_path_factory.mktemp("result")
    (folder / "s.toml").write_text(STUDY)
    sweep.run(sweep.study(folder / "s.toml", allow_import=True), folder / "r.h5", progress=False).close()
    return folder


@pytest.fixture
def here(result, tmp_path, monkeypatch):
    monkeypatch.chdir(shutil.copytree(result, tmp_path, dirs_exist_ok=True))
    return tmp_path


@pytest.mark.parametrize("name", KINDS)
def test_what_is_there_is_overwritten_by_force_alone(here, name, call):
    (here / name).write_text("# notes of a whole year\n1.0\n")
    code, _, complained = call(*KINDS[name])
    assert (code, "--force" in complained) == (2, True)
    assert (here / name).read_text() == "# notes of a whole year\n1.0\n"
    assert call(*KINDS[name], "--force")[0] == 0
    written = (here / name).stat()
    assert call(*KINDS[name])[0] == 2
    assert (here / name).stat().st_mtime_ns == written.st_mtime_ns


@pytest.mark.parametrize("force", [(), ("--force",)])
@pytest.mark.parametrize(
    "argv",
    [
        ("report", "r.h5", "-o", "r.h5"),
        ("report", "r.h5", "-o", "./same.html"),
        ("report", "r.h5", "-o", "link.html"),
        ("fit", "r.h5", "--y", "fall_time", "--x", "height", "-o", "r.h5"),
        ("refine", "r.h5", "--y", "fall_time", "--tolerance", "0.1", "-o", "r.h5"),
        ("chart", "s.toml", "--allow-import", "-o", "s.toml"),
        ("export", "r.nc", "-o", "r.nc"),
        ("plot", "r.png", "-o", "r.png"),
    ],
)
def test_what_is_read_is_never_overwritten(here, argv, force, call):
    for name in ("same.html", "r.nc", "r.png"):
        os.link("r.h5", name)
    Path("link.html").symlink_to("r.h5")
    before = [Path(name).read_bytes() for name in ("r.h5", "s.toml")]
    code, _, complained = call(*argv, *force)
    assert (code, "is the file being read" in complained) == (2, True)
    assert [Path(name).read_bytes() for name in ("r.h5", "s.toml")] == before


def test_what_an_export_reads_is_never_overwritten_from_python_either(here):
    os.link("r.h5", "r.nc")
    with sweep.open_result("r.h5") as ds, pytest.raises(SweepError, match="is the file being read"):
        sweep.export(ds, "r.nc", force=True)
    assert sweep.verify("r.h5").whole


def test_a_result_is_no_earlier_export_of_itself(here, call):
    """A result may be called .nc; exported over, it would lose its digests."""
    Path("other.nc").write_bytes(Path("r.h5").read_bytes())
    assert call("export", "r.h5", "-o", "other.nc")[0] == 2
    assert sweep.verify("other.nc").whole


def full_once(rename):
    """As `rename`, but the second one finds no room."""
    calls = iter([rename, None, rename])

    def renamed(*paths):
        do = next(calls)
        if do is None:
            raise OSError(errno.ENOSPC, "No space left on device")
        do(*paths)

    return renamed


def test_a_folder_of_zarr_gives_way_when_forced_and_to_what_is_complete_alone(here):
    """What is a folder and no zarr is left alone: `test_cli.py`."""
    with sweep.open_result("r.h5") as ds:
        sweep.export(ds, "a.zarr")
        Path("a.zarr/thesis.txt").write_text("all of it")
        with pytest.raises(SweepError, match="exists already"):
            sweep.export(ds, "a.zarr")
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(disk, "rename", full_once(disk.rename))
            with pytest.raises(SweepError, match="cannot be written"):
                sweep.export(ds, "a.zarr", force=True)
        assert Path("a.zarr/thesis.txt").read_text() == "all of it"
        sweep.export(ds, "a.zarr", force=True)
        assert not Path("a.zarr/thesis.txt").exists()


def test_an_export_on_the_disk_is_whole(here, monkeypatch):
    """Every file and folder of it is synced before it gets its name, and the name after."""
    order = []
    monkeypatch.setattr(
        disk, "fsync", lambda fd: order.append(str(Path(f"/proc/self/fd/{fd}").readlink()).partition(".tmp")[2])
    )
    rename = disk.rename
    monkeypatch.setattr(disk, "rename", lambda old, new: (order.append("rename"), rename(old, new)))
    with sweep.open_result("r.h5") as ds:
        sweep.export(ds, "a.csv")
        assert order == ["", "rename", ""]
        order.clear()
        sweep.export(ds, "a.zarr")
    files = {f"/{path.relative_to('a.zarr')}" for path in Path("a.zarr").rglob("*")}
    assert set(order[:-2]) == files | {""}
    assert order[-2:] == ["rename", ""]
