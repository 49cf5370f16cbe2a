"""A sampled block, repeated over another, with a condition: every command takes it, or says in a sentence why not."""

import pytest

from sweep.cli import main

STUDY = """\
# How long does it fall?
kernel = "toy:KERNEL"
outputs = ["fall_time"]
where = "v0**2 < g*height"

[[blocks]]
design = { kind = "sobol", n = 16, seed = 1 }
axes.height = { spacing = "log", start = 1, stop = 100 }
axes.v0 = { spacing = "linear", start = 0, stop = 20 }

[[blocks]]
axes.g = [1.62, 9.81]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("designs")
    (place / "fall.toml").write_text(STUDY)
    return place


@pytest.fixture
def told(folder, monkeypatch, capsys):
    """Runs a command, and gives its exit status and what it said."""
    monkeypatch.chdir(folder)

    def told(*words):
        code = main(list(words))
        said = capsys.readouterr()
        return code, said.out + said.err

    if not (folder / "fall.h5").exists():
        assert told("run", "fall.toml", "--allow-import")[0] == 0
    return told


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (("plan", "fall.toml", "--allow-import"), "32 = point 16 x g 2"),
        (("show", "fall.h5"), "not asked"),
        (("show", "fall.h5"), "where     v0**2 < g*height"),
        (("verify", "fall.h5"), "whole"),
        (("plot", "fall.h5", "--x", "height", "--force"), "fall_plot.png"),
        (("report", "fall.h5", "--force"), "fall.html"),
        (("export", "fall.h5", "-o", "fall.csv", "--force"), "fall.csv"),
        (("export", "fall.h5", "-o", "ok.csv", "--where", "status == 'OK' and g > 5", "--force"), "ok.csv"),
        (("diff", "fall.h5", "fall.h5"), "the same"),
        (("list", "."), "How long does it fall?"),
        (("chart", "fall.toml", "--allow-import", "--cells", "8", "--rtol", "1e-3"), "exact"),
    ],
)
def test_a_command_takes_it(told, words, part):
    code, said = told(*words)
    assert code == 0, said
    assert part in said


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (("fit", "fall.h5", "--x", "height", "--y", "fall_time"), "sort first"),
        (("refine", "fall.h5", "--y", "fall_time", "--tolerance", "0.1", "-o", "r.h5", "--allow-import"), "refined"),
    ],
)
def test_a_command_says_why_not(told, words, part):
    code, said = told(*words)
    assert code == 2
    assert part in said


def test_it_cannot_be_extended_and_says_why(told, folder):
    (folder / "more.toml").write_text(STUDY.replace("n = 16", "n = 32"))
    code, said = told("run", "more.toml", "-o", "fall.h5", "--extend", "--allow-import")
    assert code == 2
    assert 'its design is not "product"' in said
