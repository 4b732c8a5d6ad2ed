"""What the compose file starts, started here: its commands, environments and health checks, as processes on loopback.

With the TLS file on top, and certificates made by the script beside it.
"""

import os
import re
import shutil
import socket
import subprocess
import sys
import time
from contextlib import contextmanager, nullcontext
from pathlib import Path

import dask
import pytest

from datagen import verify
from datagen.farming.cluster import connect
from shared.errors import ClusterError
from tests.docker.compose import FOLDER, load, words_of
from tests.docker.images import ROOT

pytestmark = pytest.mark.slow
BIN = Path(sys.executable).parent
TLS = "DASK_DISTRIBUTED__COMM__TLS__"
VARIABLES = {"ZEROSHOT_COUNT": "2", "ZEROSHOT_SEED": "5"}


def free_ports(count):
    probes = [socket.socket() for _ in range(count)]
    for probe in probes:
        probe.bind(("127.0.0.1", 0))
    ports = [probe.getsockname()[1] for probe in probes]
    for probe in probes:
        probe.close()
    return ports


class Here:
    """Translates what a service is given in its container to this machine."""

    def __init__(self, folder, services):
        self.services = services
        self.folder = folder
        (folder / "data").mkdir()
        (folder / "tmp").mkdir()
        scheduler, dashboard, worker = free_ports(3)
        self.scheduler = scheduler
        self.there = {
            "scheduler:8786": f"127.0.0.1:{scheduler}",
            "--port=8786": f"--port={scheduler}",
            "address=:8787": f"address=127.0.0.1:{dashboard}",
            "127.0.0.1:8787": f"127.0.0.1:{dashboard}",
            "127.0.0.1:8788": f"127.0.0.1:{worker}",
            "/run/secrets": str(folder / "certificates"),
            "/systems": str(ROOT / "fmus"),
            "=/data": f"={folder / 'data'}",
            "=/tmp": f"={folder / 'tmp'}",
        }

    def __call__(self, text):
        return re.sub("|".join(map(re.escape, self.there)), lambda found: self.there[found[0]], text)

    def environment(self, name):
        ours = {key: value for key, value in os.environ.items() if not key.startswith("DASK_")}
        given = {key: self(value) for key, value in self.services[name].get("environment", {}).items()}
        return {**ours, **given, "OMP_NUM_THREADS": "1"}

    def words(self, name, *more):
        """The service's command; what is given as --NAME=VALUE takes the place of what it has."""
        program, *rest = words_of(self.services[name])
        kept = [self(word) for word in rest if word.split("=")[0] not in [other.split("=")[0] for other in more]]
        return [str(BIN / program), *kept, *more]

    def start(self, name, *more):
        with open(self.folder / f"{name}.log", "w") as log:
            return subprocess.Popen(
                self.words(name, *more), env=self.environment(name), stdout=log, stderr=log, cwd=self.folder
            )

    def healthy(self, name):
        kind, *words = self.services[name]["healthcheck"]["test"]
        assert kind == "CMD"
        command = [sys.executable, *(self(word) for word in words[1:])]
        return subprocess.run(command, capture_output=True, timeout=70).returncode == 0

    def wait_for_health(self, name, seconds=90):
        end = time.monotonic() + seconds
        while not self.healthy(name):
            assert time.monotonic() < end, (self.folder / f"{name}.log").read_text()
            time.sleep(0.5)

    def datagen(self, *more):
        return subprocess.run(
            self.words("datagen", "--hours=24", *more),
            env=self.environment("datagen"),
            cwd=self.folder,
            capture_output=True,
            text=True,
            timeout=200,
        )


@contextmanager
def farm(folder, services):
    here = Here(folder, services)
    # in the container the scheduler listens on the farm's network; here on loopback alone
    running = []
    try:
        running.append(here.start("scheduler", "--host=127.0.0.1"))
        here.wait_for_health("scheduler")
        running.append(here.start("worker"))
        here.wait_for_health("worker")
        yield here
    finally:
        for process in reversed(running):
            process.terminate()
        for process in running:
            process.wait(30)


def certificates(folder):
    done = subprocess.run(
        ["sh", str(FOLDER / "certificates.sh"), str(folder), "2"], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="module")
def guarded(tmp_path_factory):
    """A farm with TLS, up for all tests that ask what it refuses."""
    if not shutil.which("openssl"):
        pytest.skip("no openssl on the PATH to make certificates with")
    folder = tmp_path_factory.mktemp("guarded")
    certificates(folder / "certificates")
    services = load("compose.yaml", "compose.tls.yaml", variables={**VARIABLES, "ZEROSHOT_SCHEME": "tls"})["services"]
    with farm(folder, services) as here:
        yield here


def test_certificates_last_as_asked_and_serve_only_their_purpose(guarded):
    folder = guarded.folder / "certificates"

    def asked(name, *words):
        words = ["openssl", "x509", "-noout", *words, "-in", str(folder / f"{name}.pem")]
        return subprocess.run(words, capture_output=True, text=True)

    for role in ("scheduler", "worker", "client"):
        assert "CA:FALSE" in asked(role, "-text").stdout
    assert asked("ca", "-checkend", str(3 * 86400)).returncode == 1
    assert not (folder / "ca.key").exists()


def test_the_compose_farm_makes_a_dataset(guarded):
    done = guarded.datagen()
    assert done.returncode == 0, done.stderr
    assert "2 of 2 systems" in done.stdout
    assert verify(guarded.folder / "data" / "rooms") == []
    assert f"tls://127.0.0.1:{guarded.scheduler}" in (guarded.folder / "scheduler.log").read_text()


def test_a_farm_with_tls_refuses_all_but_clients_of_its_own(guarded, tmp_path, monkeypatch):
    """One of another authority, one that believes in another authority, and one that speaks tcp."""
    others, settings = certificates(tmp_path / "others"), guarded.environment("datagen")
    theirs = {f"{TLS}CLIENT__CERT": str(others / "client.pem"), f"{TLS}CLIENT__KEY": str(others / "client.key")}
    for scheme, change, gets_in in (
        ("tls", {}, True),
        ("tls", theirs, False),
        ("tls", {f"{TLS}CA_FILE": str(others / "ca.pem")}, False),
        ("tcp", {"DASK_DISTRIBUTED__COMM__REQUIRE_ENCRYPTION": "False"}, False),
    ):
        if not gets_in:  # one that is let in may take its time on a busy machine
            monkeypatch.setattr("datagen.farming.cluster.ANSWER", 3.0)
        found = dask.config.collect_env(settings | change)
        refused = pytest.raises(ClusterError, match="no Dask scheduler answers")
        with (
            dask.config.set(dask.config.merge(dask.config.config, found)),
            nullcontext() if gets_in else refused,
            connect(scheduler=f"{scheme}://127.0.0.1:{guarded.scheduler}"),
        ):
            pass
