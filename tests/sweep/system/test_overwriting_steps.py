"""What is known of a file by its beginning and its words, and what is refused."""

import pytest

from sweep.system.errors import SweepError
from sweep.system.overwriting import MARKS, check_target

OURS = {
    ".csv": b"# exported by foliot\nmu\n",
    ".parquet": b"PAR1...exported by foliot...",
    ".nc": b"\x89HDF\r\nexported by foliot",
    "laws": b"y,x,law,a\n",
    "page": b'<!DOCTYPE html>\n<meta name="generator" content="foliot">',
    ".png": b"\x89PNG\r\nSoftware\0foliot",
    ".svg": b"<?xml ?><dc:title>foliot</dc:title>",
    ".pdf": b"%PDF-1.4 /Creator (foliot)",
}


def refused(target, kind, **keys):
    try:
        check_target(target, kind, **keys)
    except SweepError as error:
        return str(error)
    return ""


@pytest.fixture
def target(tmp_path):
    return tmp_path / "file"


@pytest.mark.parametrize("kind", MARKS)
def test_a_file_is_ours_by_its_beginning_and_by_words_in_it(target, kind):
    assert refused(target, kind) == ""
    target.write_bytes(OURS[kind])
    assert refused(target, kind) == ""
    for other in (
        b"x" + OURS[kind],
        OURS[kind].replace(b"foliot", b"others").replace(b"law", b"lax"),
        b"",
        OURS[kind][:2],
    ):
        target.write_bytes(other)
        assert refused(target, kind).startswith(f"{target} is there already")
        assert refused(target, kind, force=True) == ""
        assert refused(target, "other kind") == ""


def test_a_folder_is_no_file_of_ours(target):
    target.mkdir()
    assert "is there already" in refused(target, ".csv")
    assert "is there already" in refused(target, ".zarr")
    (target / "zarr.json").write_bytes(b"{}")
    assert "is there already" in refused(target, ".zarr")
    (target / "zarr.json").write_bytes(b'{"history": "exported by foliot"}')
    assert refused(target, ".zarr") == ""
    file = target / "zarr.json"
    assert "is there already" in refused(file, ".zarr")


def test_what_is_read_is_never_overwritten(target, tmp_path):
    target.write_bytes(OURS[".csv"])
    (tmp_path / "link").symlink_to(target)
    for read in (target, tmp_path / "link", tmp_path / "." / "file"):
        assert refused(target, ".csv", force=True, read=[tmp_path / "x", read]) == (
            f"{target} is what is read; name another file"
        )
    assert refused(target, ".csv", read=[tmp_path / "x"]) == ""
    # neither is there yet
    assert "is what is read" in refused(tmp_path / "a" / ".." / "new", ".csv", read=[tmp_path / "new"])
