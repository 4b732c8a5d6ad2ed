"""The images' Dockerfiles: what they promise, and (slow) what their steps install."""

import json
import os
import shutil
import subprocess
import sys
from contextlib import ExitStack
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory

import psutil
import pytest

from tests.docker.compose import image_file
from tests.docker.images import ROOT, build, context, read
from tests.packaging.wheels import HOLDS, PROMISES, index_answers

IMAGES = ("datagen", "trainer")
RECIPE = ROOT / "fmus" / "modelica" / "Dockerfile"
LIMIT_MB = {"datagen": 800, "trainer": 1300}
"""Nothing large has come in unnoticed."""


@pytest.fixture(params=IMAGES)
def image(request):
    return read(image_file(request.param))


@pytest.mark.parametrize("path", [*map(image_file, IMAGES), RECIPE], ids=[*IMAGES, "modelica"])
def test_hadolint_finds_nothing(path):
    hadolint = shutil.which("hadolint", path=f"{sys.prefix}/bin:{sys.prefix}/Scripts")
    done = subprocess.run([hadolint, "--no-color", str(path)], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (0, "")


def test_no_address_of_an_index_is_written_down(image):
    text = image.path.read_text()
    assert "://" not in text
    assert image.arguments["PIP_INDEX"] is None
    assert '--extra-index-url "$PIP_INDEX"' in text


def test_the_context_is_what_the_wheel_is_made_of():
    files = context()
    tops = {name.split("/")[0] for name in files}
    ours = {"shared", "datagen", "trainer", "diagnosis", "fmus"}
    assert tops == ours | {"LICENSE", "README.md", "constraints.txt", "pyproject.toml"}
    assert {"fmus/MixedAirCO2.fmu", "fmus/MixedAirCO2/system.toml", "shared/system.py"} <= {*files}
    assert not [name for name in files if "__pycache__" in name or name.endswith((".nbi", ".nbc", ".pyc"))]


# the trainer's steps are the same with another extra, and all modules are imported from the wheel in
# packaging/test_wheel.py, unless more is asked for
ALL = "ZEROSHOT_PYTHONS" in os.environ
CARRIED_OUT = IMAGES if ALL else IMAGES[:1]


@pytest.fixture(scope="module", params=CARRIED_OUT)
def built(request, tmp_path_factory):
    """An image's steps, carried out."""
    described = read(image_file(request.param))
    python = shutil.which(f"python{described.python}")
    if sys.version_info[:2] == tuple(map(int, described.python.split("."))):
        python = sys._base_executable
    if python is None:
        pytest.skip(f"the image has Python {described.python}, and there is none on the PATH")
    if not index_answers():
        pytest.skip("pip reaches no index that has setuptools, so it cannot install anything")
    with ExitStack() as stack:
        memory = Path("/dev/shm")
        if has_room(memory):
            folder = Path(stack.enter_context(TemporaryDirectory(prefix=f"{request.param}-", dir=memory)))
        else:
            folder = tmp_path_factory.mktemp(request.param)
        yield build(described, folder / "root", python)


def has_room(folder):
    """Whether an image fits into a file system in memory: its ten thousand files take far longer on a disk."""
    if not folder.is_dir() or os.statvfs(folder).f_flag & os.ST_NOEXEC or not os.access(folder, os.W_OK):
        return False
    return min(shutil.disk_usage(folder).free, psutil.virtual_memory().available) > 8e9


@pytest.mark.slow
def test_the_steps_install_what_the_image_is_for(built, tmp_path):
    name = built.final.last("ENTRYPOINT").value[0]
    megabytes = built.megabytes()  # before programs have run: what they compile is not the image's
    promise = PROMISES[name]
    done = built.run("python", "-c", HOLDS, *(promise.imports if ALL else ()), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    installed = {*found["distributions"]}
    assert promise.present <= installed and not promise.absent & installed
    tools = {"pip", "setuptools", "cmake"}
    # torch itself requires setuptools
    assert tools & installed <= ({"setuptools"} if name == "trainer" else set())
    assert found["where"].startswith(str(built.inside("/opt/zeroshot"))) and (found["modules"] > 10) == ALL
    assert megabytes < LIMIT_MB[name]
    assert name != "datagen" or (built.inside("/systems/MixedAirCO2") / "system.toml").is_file()
    check = built.run(*built.final.last("HEALTHCHECK").value[1:], cwd=tmp_path)
    assert (check.returncode, check.stdout.strip()) == (0, version("zeroshot-fmu"))
    assert "group --gid 10001" in built.accounts and "user --uid 10001 --gid 10001" in built.accounts
