"""The recipes of the README for Slurm and SSH, as far as one machine can run them."""

import os
import signal
from datetime import datetime, timedelta

import pytest
from running import environment, quiet, same, tall

distributed = pytest.importorskip("distributed")
WARNINGS = ("ResourceWarning", "pytest.PytestUnraisableExceptionWarning")
WARNINGS += ("DeprecationWarning", "FutureWarning", "UserWarning")
pytestmark = [pytest.mark.filterwarnings(f"ignore::{kind}") for kind in WARNINGS]

STUDY = tall(50)
SBATCH = """#!/bin/sh
# runs a job script where it is, as a batch system would on another machine
cp "$1" "{folder}/job.sh"
setsid sh "{folder}/job.sh" > "{folder}/job.log" 2>&1 &
echo "Submitted batch job $!"
"""
SCANCEL = """#!/bin/sh
kill -- "-$1"
"""


def whole(cluster, output):
    """The study on a cluster of a recipe, which has its workers some time later."""
    with distributed.Client(cluster) as client:
        until = datetime.now() + timedelta(seconds=120)
        with quiet(STUDY, output, workers=None, cluster=client, until=until) as found:
            same(found, quiet(STUDY))


def script(path, text):
    path.write_text(text)
    path.chmod(0o755)


@pytest.fixture
def jobqueue():
    """dask-jobqueue; its import makes Ctrl-C exit with status 0, which is taken back for the tests after this one."""
    before = signal.getsignal(signal.SIGINT)
    yield pytest.importorskip("dask_jobqueue", reason="needs the package dask-jobqueue")
    signal.signal(signal.SIGINT, before)


def test_the_job_script_for_slurm_makes_a_worker_that_takes_part(jobqueue, tmp_path, monkeypatch):
    """dask-jobqueue renders it; in place of sbatch a shell executes it."""
    script(tmp_path / "sbatch", SBATCH.format(folder=tmp_path))
    script(tmp_path / "scancel", SCANCEL)
    for name, value in {**environment(), "PATH": f"{tmp_path}:{os.environ['PATH']}"}.items():
        monkeypatch.setenv(name, value)
    with jobqueue.SLURMCluster(
        cores=1, processes=1, memory="1GB", walltime="00:10:00", local_directory=str(tmp_path),
        scheduler_options={"host": "127.0.0.1", "dashboard_address": None},
    ) as cluster:  # fmt: skip
        assert "#SBATCH --cpus-per-task=1" in cluster.job_script()
        cluster.scale(jobs=1)
        whole(cluster, tmp_path / "out.h5")
    assert "#SBATCH -t 00:10:00" in (tmp_path / "job.sh").read_text()
