"""The recipes of the README for Slurm and SSH, as far as one machine can run them."""

import getpass
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from datetime import datetime, timedelta
from pathlib import Path

import pytest
from running import environment, quiet, same, tall

distributed = pytest.importorskip("distributed")
WARNINGS = ("ResourceWarning", "pytest.PytestUnraisableExceptionWarning")
WARNINGS += ("DeprecationWarning", "FutureWarning", "UserWarning")
pytestmark = [pytest.mark.filterwarnings(f"ignore::{kind}") for kind in WARNINGS]

STUDY = tall(50)
SSHD = shutil.which("sshd") or shutil.which("sshd", path="/usr/sbin")
SBATCH = """#!/bin/sh
# runs a job script where it is, as a batch system would on another machine
cp "$1" "{folder}/job.sh"
setsid sh "{folder}/job.sh" > "{folder}/job.log" 2>&1 &
echo "Submitted batch job $!"
"""
SCANCEL = """#!/bin/sh
kill -- "-$1"
"""
SSHD_CONFIG = """
HostKey {folder}/host
AuthorizedKeysFile {folder}/authorized
PidFile none
StrictModes no
UsePAM no
PasswordAuthentication no
PermitRootLogin yes
PermitUserEnvironment yes
ListenAddress 127.0.0.1
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


@pytest.fixture
def sshd(tmp_path):
    """A server on this machine that lets in who has the key, with the paths of the tests; its port."""
    if SSHD is None:
        pytest.skip("needs sshd (Debian: apt-get install openssh-server)")
    for name in ("host", "key"):
        subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", tmp_path / name], check=True)
    path = environment()["PYTHONPATH"]
    (tmp_path / "authorized").write_text(f'environment="PYTHONPATH={path}" {(tmp_path / "key.pub").read_text()}')
    (tmp_path / "config").write_text(SSHD_CONFIG.format(folder=tmp_path))
    if os.getuid() == 0:
        Path("/run/sshd").mkdir(exist_ok=True)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    process = subprocess.Popen([SSHD, "-D", "-e", "-f", tmp_path / "config", "-p", str(port)], stderr=-3)
    deadline = time.monotonic() + 20
    while time.monotonic() < deadline:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                break
        time.sleep(0.05)
    yield port
    process.terminate()
    process.wait()


def test_machines_that_ssh_reaches_take_part(sshd, tmp_path):
    pytest.importorskip("asyncssh", reason="needs the package asyncssh")
    keys = {"port": sshd, "username": getpass.getuser(), "client_keys": [str(tmp_path / "key")], "known_hosts": None}
    with distributed.SSHCluster(
        ["127.0.0.1", "127.0.0.1"], connect_options=keys, remote_python=sys.executable,
        worker_options={"nthreads": 1}, scheduler_options={"dashboard": False},
    ) as cluster:  # fmt: skip
        whole(cluster, tmp_path / "out.h5")
