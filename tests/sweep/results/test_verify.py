"""Damage of every kind is found; what is whole is said to be."""

import itertools
import os
import random
import shutil

import h5py
import numpy as np
import pytest
import toy_studies
from running import flip, interrupted, kept, place, quiet, same, tall

import sweep
from sweep.cli import main
from sweep.results.verify import verify
from sweep.store import probe
from sweep.store.reading import StoredFile
from sweep.store.store import Store, unfinished_of


def study(**keys):
    axes = {"height": np.arange(1.0, 41), "v0": [0.0, 0.5, 3.0]}
    return toy_studies.build(axes=axes, outputs=["fall_time", "drop"], along={"phase": [0.0, 0.5, 1.0]}, **keys)


SUMMARY = {"over": ["height"], "outputs": {"fall_time": ["min", "mean", "argmin"]}}


@pytest.fixture(scope="module", params=["cells", "summary"])
def whole(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "out.h5"
    made = study() if request.param == "cells" else study(summary=SUMMARY)
    sweep.run(made, path, block_cells=50, progress=False).close()
    return path


@pytest.fixture
def copy(whole, tmp_path):
    return shutil.copy(whole, tmp_path / "out.h5")


def test_a_whole_result_is_whole(copy, capsys):
    assert verify(copy).whole
    assert main(["verify", str(copy)]) == 0
    assert "whole; " in capsys.readouterr().out


def test_a_flipped_bit_anywhere_is_found(copy):
    """Every byte of a small file; HDF5 itself is asked about a part of them only, for it takes long."""
    size = copy.stat().st_size
    rng = random.Random(3)
    for at in rng.sample(range(size), 300):
        flip(copy, at)
        assert not verify(copy).whole, at
        flip(copy, at)
    assert verify(copy).whole


def test_a_flipped_bit_in_an_output_is_told_with_its_cells(copy):
    with StoredFile(copy) as file:
        name = "drop" if "drop" in file.columns() else "fall_time_mean"
        step = file.layout.tables["cells"].blocks.bounds(0)[1]
    flip(copy, place(copy, name, 2) + 1, bit=5)
    (found,) = verify(copy).findings
    assert found == f"{name}: damaged between its cells 0 and {step}"


@pytest.mark.parametrize("share", [0.0, 0.01, 0.3, 0.9, 0.999])
def test_a_cut_file_is_found(copy, share, capsys):
    size = copy.stat().st_size
    os.truncate(copy, min(int(share * size), size - 1))
    assert not verify(copy).whole
    assert main(["verify", str(copy)]) == 2
    assert "not whole" in capsys.readouterr().err


def test_a_longer_file_is_found(copy):
    with copy.open("ab") as file:
        file.write(b"\0")
    assert not verify(copy).whole


@pytest.mark.parametrize("what", ["attribute", "coordinate", "status", "units"])
def test_what_hdf5_changes_is_found(copy, what):
    with h5py.File(copy, "r+") as file:
        if what == "attribute":
            file.attrs["title"] = "another stone"
        elif what == "coordinate":
            file["height"][3] = 7.25
        elif what == "units":
            file[next(name for name in file if name.startswith("fall_time"))].attrs["units"] = "minute"
        elif "status" in file:
            file["status"][0] = 64
        else:
            file["cells_by_status"][0, 0] += 1
    assert not verify(copy).whole


def test_what_is_no_result_is_told(tmp_path, capsys):
    path = tmp_path / "out.h5"
    with pytest.raises(sweep.SweepError, match="no such file"):
        verify(path)
    path.write_bytes(b"words")
    assert main(["verify", str(path)]) == 2
    assert main(["verify", str(tmp_path)]) == 2
    assert "is a folder" in capsys.readouterr().err


def swapped(path, one, other):
    """Exchanges spans of a file: (begin, length) each."""
    content = bytearray(path.read_bytes())
    (a, n), (b, m) = one, other
    content[a : a + n], content[b : b + m] = content[b : b + m], content[a : a + n]
    path.write_bytes(content)


@pytest.mark.parametrize("digests_too", [False, True])
def test_chunks_that_changed_places_are_found(whole, copy, digests_too):
    """HDF5's own checksum sees nothing of it; neither would digests that do not say of which chunk they are."""
    with StoredFile(copy) as file:
        table = file.layout.work
        column = table.places[0]
        spans = [(column.at(block), table.stored(column, block)) for block in (0, 1)]
        digests = [(table.digests + block * table.row_bytes, 16) for block in (0, 1)]
    if copy.read_bytes()[spans[0][0] :][:8] == copy.read_bytes()[spans[1][0] :][:8]:
        pytest.skip("the same numbers")
    swapped(copy, *spans)
    if digests_too:
        swapped(copy, *digests)
    found = verify(copy)
    assert not found.whole
    assert found.blocks == (0, 1)


def test_what_another_program_changed_is_told(copy):
    with h5py.File(copy, "r+") as file:
        file.attrs["comment"] = "mine"
    assert verify(copy).findings == ("was changed by another program, which left its digests out",)


@pytest.mark.parametrize("place", ["between", "digests", "ending"])
def test_damage_between_the_chunks_and_of_digests_is_found(copy, place):
    with StoredFile(copy) as file:
        table, layout = file.layout.work, file.layout
    at = {"digests": table.digests + 3, "ending": layout.endings[1][0]}
    if place == "between":
        spans = table.spans()
        holes = [end for (_, end), (begin, _) in itertools.pairwise(spans) if begin > end]
        if not holes:
            pytest.skip("there is nothing between them")
        at["between"] = int(holes[0])
    flip(copy, at[place])
    assert not verify(copy).whole


@pytest.fixture
def unfinished(tmp_path):
    interrupted(tall(23), tmp_path / "out.h5")
    return tmp_path / "out.h5"


def test_what_is_there_of_an_unfinished_result_is_told_with_what_is_missing(unfinished):
    found = verify(unfinished)
    assert not found.whole
    assert found.findings[0].startswith("missing: cells 10 to 15")
    assert f"{len(kept(unfinished))} of 5 blocks" in found.checked


def test_damaged_blocks_of_an_unfinished_result_are_named(unfinished):
    path = unfinished_of(unfinished)
    flip(path, place(path, "fall_time", 1) + 2)
    assert verify(unfinished).findings[0] == "fall_time: damaged between its cells 0 and 5"


@pytest.mark.parametrize("kind", ["cells", "summary"])
@pytest.mark.parametrize("what", ["one", "several", "every", "digests", "made"])
def test_a_damaged_result_is_repaired_and_nothing_else_is_computed(tmp_path, monkeypatch, kind, what):
    made, path = study(summary=SUMMARY) if kind == "summary" else study(), tmp_path / "out.h5"
    quiet(made, path, block_cells=20).close()
    before = path.read_bytes()
    with StoredFile(path) as file:
        table, made_of = file.layout.work, file.layout.tables["cells"]
    bad = {"one": [1], "several": [0, 3], "every": range(table.blocks.count), "digests": [2], "made": []}[what]
    bad = [block % table.blocks.count for block in bad]
    for block in bad:
        flip(path, table.digests + block * table.row_bytes + 1 if what == "digests" else table.places[0].at(block) + 1)
    if what == "made":
        flip(path, made_of.places[0].at(0))
        bad = [0] if kind == "cells" else []
    with pytest.raises(sweep.SweepError, match="run --repair computes damaged cells again, and nothing else"):
        quiet(made, path)
    put, real = [], Store.put
    monkeypatch.setattr(Store, "put", lambda self, index, arrays: put.append(index) or real(self, index, arrays))
    with quiet(made, path, repair=True) as found:
        same(found, quiet(made))
    assert sorted(put) == sorted(set(bad))
    assert verify(path).whole
    assert list(tmp_path.iterdir()) == [path]
    assert differing(before, path.read_bytes()) <= 25 + 25 + 12 + 16  # times and their digest


def differing(one, other):
    """Bytes that differ."""
    assert len(one) == len(other)
    return sum(a != b for a, b in zip(one, other, strict=True))


def test_a_repair_that_is_stopped_goes_on_like_any_run(tmp_path, monkeypatch):
    path = tmp_path / "out.h5"
    quiet(tall(23), path, block_cells=5).close()
    flip(path, place(path, "fall_time", 7))
    with monkeypatch.context() as patch:
        patch.setattr("sweep.runs.to_file._finish", lambda *rest: (_ for _ in ()).throw(sweep.SweepError("stopped")))
        with pytest.raises(sweep.SweepError, match="stopped"):
            quiet(tall(23), path, repair=True)
    assert not path.exists()
    assert kept(path) == [0, 2, 3, 4]
    same(quiet(tall(23), path), quiet(tall(23)))


def test_a_whole_result_needs_no_repair(tmp_path):
    path = tmp_path / "out.h5"
    quiet(tall(23), path).close()
    before = path.read_bytes()
    quiet(tall(23), path, repair=True).close()
    assert path.read_bytes() == before


def test_a_damaged_structure_cannot_be_repaired(tmp_path):
    path = tmp_path / "out.h5"
    quiet(tall(23), path).close()
    flip(path, path.read_bytes().index(b"toy:KERNEL"))
    with pytest.raises(sweep.SweepError, match="damaged"):
        quiet(tall(23), path, repair=True)
    assert path.exists()


def test_a_result_of_absurd_size_is_refused_before_memory_is_asked_for(tmp_path, monkeypatch):
    monkeypatch.setattr(probe, "PROBE_SECONDS", 1.0)  # HDF5 comes to no end with it
    path = tmp_path / "out.h5"
    sweep.run(tall(3), path, progress=False).close()
    with h5py.File(path, "r+") as file:
        for name in ("fall_time", "status"):
            attrs = dict(file[name].attrs)
            del file[name]
            dataset = file.create_dataset(name, (1 << 44,), "f8" if name == "fall_time" else "i1", chunks=(1 << 20,))
            for key in ("units", "flag_values", "flag_meanings"):
                if key in attrs:
                    dataset.attrs[key] = attrs[key]
    for action in (sweep.open_result, lambda path: sweep.run(tall(3), path, progress=False)):
        with pytest.raises(sweep.SweepError, match="damaged"):
            action(path)
    assert main(["show", str(path)]) == 2
