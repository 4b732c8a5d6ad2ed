"""What the guide to clusters tells users to type does what it is there for."""

import os
import re
import shlex
import subprocess
from pathlib import Path

import dask
import pytest

from datagen.cli import app
from datagen.commands.run import _options
from datagen.farming.cluster import _CONFIG, check_places
from tests.test_readme import DOCUMENTS

ROOT = Path(__file__).resolve().parents[2]
GUIDE = (ROOT / "docs" / "cluster.md").read_text()


def on_queues():
    for document in DOCUMENTS:
        for line in document.read_text().replace("\\\n", " ").splitlines():
            if line.startswith("datagen run") and "--cluster " in line:
                yield pytest.param(line, id=f"{document.name}: {line[-40:]}")


@pytest.mark.parametrize("line", list(on_queues()))
def test_a_command_for_a_queue_has_a_scheduler_that_jobs_reach(line):
    _, bound, _ = app.parse_args(shlex.split(line)[1:], print_error=False, exit_on_error=False)
    given = bound.arguments
    options = _options(given.get("cluster_option", []))
    check_places(cluster=given["cluster"], options=options, host=given.get("host"), workers=given["workers"])


def test_the_image_has_what_the_farm_needs(tmp_path):
    (block,) = re.findall(r"```dockerfile\n(.*?)```", GUIDE, re.DOTALL)
    copied = re.search(r"^COPY (.*) /tmp/$", block, re.MULTILINE).group(1).split()
    for name in copied:
        here = tmp_path / Path(name.replace("*", "1.0-py3-none-any")).name
        here.write_bytes((ROOT / name).read_bytes() if (ROOT / name).exists() else b"")
    command = re.search(r"^RUN (pip install .*)$", block, re.MULTILINE).group(1)
    pip = tmp_path / "bin" / "pip"
    pip.parent.mkdir()
    pip.write_text('#!/bin/sh\nfor word in "$@"; do printf "%s\\n" "$word"; done\n')
    pip.chmod(0o755)
    path = os.pathsep.join([str(pip.parent), os.environ["PATH"]])
    command = command.replace("/tmp/", f"{tmp_path}/")
    said = subprocess.run(["sh", "-ec", command], env={"PATH": path}, capture_output=True, text=True, check=True)
    words = said.stdout.splitlines()
    assert words[-1] == f"{tmp_path}/zeroshot_fmu-1.0-py3-none-any.whl[datagen]"
    assert Path(words[words.index("--constraint") + 1]).read_text() == (ROOT / "constraints.txt").read_text()


def test_a_scheduler_of_ones_own_is_told_the_settings_that_are_ours():
    exported = dict(re.findall(r"^export (DASK_\S+)=(\S+)$", GUIDE, re.MULTILINE))
    ours = dask.config.collect_env(dict(os.environ, **exported))
    with dask.config.set(ours):
        told = [name for name in _CONFIG if f"DASK_{name.upper().replace('.', '__').replace('-', '_')}" in exported]
        assert len(told) == len(exported) == 4
        assert [dask.config.get(name) for name in told] == [_CONFIG[name] for name in told]
