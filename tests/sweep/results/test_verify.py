"""Damage of every kind is found; what is whole is said to be."""

import dataclasses
import os
import random
import shutil

import h5py
import numpy as np
import pytest
import toy_studies
from running import fail_on, flip, interrupted, tall

import sweep
from sweep.cells.partition import Partition
from sweep.cli import main
from sweep.results.verify import verify
from sweep.store import probe
from sweep.store.manifest import MANIFEST, read_manifest
from sweep.store.store import folder_of


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
    for place in rng.sample(range(size), 300):
        flip(copy, place)
        assert not verify(copy).whole, place
        flip(copy, place)
    assert verify(copy).whole


def test_a_flipped_bit_in_an_output_is_told_with_its_cells(copy):
    with h5py.File(copy) as file:
        name = "drop" if "drop" in file else "fall_time_mean"
        dataset = file[name]
        place, cell_bytes = dataset.id.get_offset(), dataset.nbytes // file["integrity/digests"].attrs["size"][0]
        step = file["integrity/digests"].attrs["cells"][0]
    flip(copy, place + cell_bytes * 2 + 1, bit=5)
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


def test_a_result_without_digests_is_told(copy):
    with h5py.File(copy, "r+") as file:
        del file["integrity"]
    with pytest.raises(sweep.SweepError, match="has no digests"):
        verify(copy)


@pytest.fixture
def unfinished(tmp_path):
    interrupted(tall(23), tmp_path / "out.h5")
    return tmp_path / "out.h5"


def parts(output):
    return sorted(folder_of(output).glob("*.h5"))


def test_sound_parts_are_told_with_what_is_missing(unfinished):
    found = verify(unfinished)
    assert not found.whole
    assert found.findings[0].startswith("missing: cells 10 to 15")
    assert f"{len(parts(unfinished))} of 5 blocks" in found.checked


def test_a_damaged_a_foreign_and_a_doubled_part_are_named(unfinished):
    first, second = parts(unfinished)[:2]
    flip(first, h5_place(first))
    foreign = folder_of(unfinished) / "holiday.jpg"
    foreign.write_text("sun")
    other = second.with_name(second.name[:26] + "0" * 32 + ".h5")
    shutil.copy(second, other)
    told = "\n".join(verify(unfinished).findings)
    assert f"damaged: {first.name}" in told
    assert "not of this sweep: holiday.jpg" in told
    assert f"twice there: {second.name}" in told
    assert f"damaged: {other.name}" in told
    assert f"damaged: {second.name}" not in told


def h5_place(path):
    with h5py.File(path) as file:
        return file["fall_time"].id.get_offset() + 2


def test_parts_of_other_cells_are_not_of_this_sweep(unfinished):
    first = parts(unfinished)[0]
    odd = first.with_name("000000000003-000000000009" + first.name[25:])
    first.rename(odd)
    assert f"not of this sweep: {odd.name}" in verify(unfinished).findings


def test_all_parts_but_no_output_is_not_whole(tmp_path, monkeypatch):
    fail_on(monkeypatch, "pwrite", 1, 5)
    with pytest.raises(sweep.SweepError):
        sweep.run(tall(23), tmp_path / "out.h5", progress=False, block_cells=5)
    monkeypatch.undo()
    assert verify(tmp_path / "out.h5").findings == (
        "all blocks are there, but not put together yet; run the sweep again to finish",
    )


@pytest.mark.parametrize("blocks", [(10**16, 5), (23, 0), (23, -5)])
def test_a_spec_that_lies_about_its_size_is_refused_at_once(unfinished, blocks):
    path = folder_of(unfinished) / MANIFEST
    path.write_text(dataclasses.replace(read_manifest(path.parent), blocks=Partition(*blocks)).to_json())
    for action in (verify, sweep.open_result, lambda path: sweep.run(tall(24), path, progress=False)):
        with pytest.raises(sweep.SweepError, match="damaged"):
            action(unfinished)


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
