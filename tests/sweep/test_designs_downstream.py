"""A sampled block, repeated over another, with a condition: every command takes it, or says in a sentence why not."""

import shlex

import pytest

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
    (place / "more.toml").write_text(STUDY.replace("n = 16", "n = 32"))
    return place


@pytest.fixture
def told(folder, monkeypatch, call):
    """The same as `call`, in the folder, with a result in it."""
    monkeypatch.chdir(folder)
    if not (folder / "fall.h5").exists():
        assert call("run", "fall.toml", "--allow-import")[0] == 0
    return call


@pytest.mark.parametrize(
    ("line", "status", "part"),
    [
        ("plan fall.toml --allow-import", 0, "32 = point 16 x g 2"), ("show fall.h5", 0, "not asked"),
        ("show fall.h5", 0, "where     v0**2 < g*height"), ("verify fall.h5", 0, "undamaged"),
        ("plot fall.h5 --x height --force", 0, "fall_plot.png"), ("report fall.h5 --force", 0, "fall.html"),
        ("export fall.h5 -o fall.csv --force", 0, "fall.csv"), ("diff fall.h5 fall.h5", 0, "identical"),
        ("export fall.h5 -o ok.csv --where \"status=='OK'\" --force", 0, "ok.csv"),
        ("list .", 0, "How long does it fall?"),
        ("chart fall.toml --allow-import --cells 8 --rtol 1e-3", 0, "exact"),
        ("fit fall.h5 --x height --y fall_time", 2, "sort first"),
        ("refine fall.h5 --y fall_time --tolerance 0.1 -o r.h5 --allow-import", 2, "refined"),
        ("run more.toml -o fall.h5 --extend --allow-import", 2, 'its design is not "product"'),
    ],
)  # fmt: skip
def test_a_command_takes_it_or_says_why_not(told, line, status, part):
    code, printed, complained = told(*shlex.split(line))
    assert code == status, complained
    assert part in printed + complained
