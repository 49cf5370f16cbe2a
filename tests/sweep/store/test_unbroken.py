"""Which byte of a result may change unseen: none of its structure, of its ending or between its chunks."""

import pytest
from handmade import finished, frame, harm

from sweep.store import reading
from sweep.store.reading import StoredFile, has_ended, padding_is_zero, unbroken


@pytest.fixture
def path(tmp_path):
    return tmp_path / "out.h5"


def judged(path, layout):
    """Whether a result is unbroken, and has ended."""
    with path.open("rb") as file:
        return unbroken(file.fileno()), has_ended(file.fileno(), layout)


def test_which_byte_breaks_a_result(path):
    layout = finished(path)
    text, digest = layout.endings[0][0], layout.endings[-1][1] - 1
    places = {
        (True, True): (layout.work.digests, layout.work.places[0].at(1)),
        (True, False): (text, layout.endings[0][1] - 1, layout.endings[-1][0], digest),
        (False, True): (0, 500, text - 1, digest + 1, layout.regions[0][0] - 1, layout.regions[0][1]),
    }
    for found, some in places.items():
        for at in some:
            assert judged(path, layout) == (True, True)
            harm(path, at)
            assert judged(path, layout) == found, at
            harm(path, at)
    for at in (layout.end, layout.size - 1):
        harm(path, at)
        with pytest.raises(OSError, match="end"):
            judged(path, layout)
        harm(path, at)


@pytest.mark.parametrize(("less", "found"), [(0, True), (1, None)])
def test_no_more_is_read_of_a_structure_than_is_allowed(path, less, found):
    layout = finished(path)
    structure = layout.end - sum(stop - begin for begin, stop in layout.regions)
    with path.open("rb") as file:
        assert unbroken(file.fileno(), structure - less) is found


def test_a_file_that_ends_early_is_broken(path, monkeypatch):
    finished(path)

    def early(*args):
        raise EOFError

    monkeypatch.setattr(reading, "structure_digest", early)
    with path.open("rb") as file:
        assert unbroken(file.fileno()) is False


@pytest.mark.parametrize("cells", [2, 4])
def test_a_byte_between_chunks_is_seen(path, cells):
    layout = finished(path, frame(cells))
    x, status = layout.work.places
    last = layout.work.blocks.count - 1
    behind = x.at(last) + x.chunk_bytes + 4
    for at in (behind, behind + 1, status.at(0) - 1):
        with StoredFile(path) as file:
            assert padding_is_zero(file)
        harm(path, at)
        with StoredFile(path) as file:
            assert not padding_is_zero(file)
        harm(path, at)
    for at in (behind - 1, status.at(0), status.at(last), layout.endings[0][0] - 1, layout.work.digests - 1):
        harm(path, at)
        with StoredFile(path) as file:
            assert padding_is_zero(file)
        harm(path, at)
