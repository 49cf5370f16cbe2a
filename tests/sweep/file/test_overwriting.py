"""What is overwritten by force, and what never."""

import errno
import os
from pathlib import Path

import pytest
from toy_studies import HEAD

import sweep
from sweep import cli
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


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("s.toml").write_text(STUDY)
    sweep.run(sweep.study("s.toml", allow_import=True), "r.h5", progress=False).close()
    return tmp_path


@pytest.mark.parametrize("name", KINDS)
def test_what_is_there_is_overwritten_by_force_alone(here, name, capsys):
    (here / name).write_text("# notes of a whole year\n1.0\n")
    assert cli.main(list(KINDS[name])) == 2
    assert "--force" in capsys.readouterr().err
    assert (here / name).read_text() == "# notes of a whole year\n1.0\n"
    assert cli.main([*KINDS[name], "--force"]) == 0
    written = (here / name).stat()
    assert cli.main(list(KINDS[name])) == 2
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
def test_what_is_read_is_never_overwritten(here, argv, force, capsys):
    for name in ("same.html", "r.nc", "r.png"):
        os.link("r.h5", name)
    Path("link.html").symlink_to("r.h5")
    before = [Path(name).read_bytes() for name in ("r.h5", "s.toml")]
    assert cli.main([*argv, *force]) == 2
    assert "is what is read; name another file" in capsys.readouterr().err
    assert [Path(name).read_bytes() for name in ("r.h5", "s.toml")] == before


def test_what_an_export_reads_is_never_overwritten_from_python_either(here):
    os.link("r.h5", "r.nc")
    with sweep.open_result("r.h5") as ds, pytest.raises(SweepError, match="is what is read"):
        sweep.export(ds, "r.nc", force=True)
    assert sweep.verify("r.h5").whole


def test_a_result_is_no_earlier_export_of_itself(here):
    """A result may be called .nc; exported over, it would lose its digests."""
    Path("other.nc").write_bytes(Path("r.h5").read_bytes())
    assert cli.main(["export", "r.h5", "-o", "other.nc"]) == 2
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


def test_a_folder_that_is_no_zarr_is_left_alone(here):
    Path("a.zarr").mkdir()
    Path("a.zarr/thesis.txt").write_text("all of it")
    with sweep.open_result("r.h5") as ds:
        for force in (False, True):
            with pytest.raises(SweepError, match="is a folder"):
                sweep.export(ds, "a.zarr", force=force)
    assert Path("a.zarr/thesis.txt").read_text() == "all of it"


def test_a_folder_of_zarr_gives_way_when_forced_and_to_what_is_complete_alone(here):
    with sweep.open_result("r.h5") as ds:
        sweep.export(ds, "a.zarr")
        Path("a.zarr/thesis.txt").write_text("all of it")
        with pytest.raises(SweepError, match="is there already"):
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
