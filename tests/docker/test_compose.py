"""The compose files against the specification's schema, and against what images and commands really are."""

import re
import shlex
from itertools import pairwise

import dask.config
import pytest
from check_jsonschema.builtin_schemas import get_builtin_schema
from distributed.cli.dask_scheduler import main as dask_scheduler
from distributed.cli.dask_worker import main as dask_worker
from jsonschema import Draft202012Validator
from jsonschema.validators import validator_for

from datagen.cli import app as datagen
from datagen.farming.cluster import _CONFIG
from tests.docker.compose import FOLDER, image_of, load, words_of
from trainer.cli import app as trainer

FILES = ("compose.yaml", "compose.tls.yaml")
SERVICES = load("compose.yaml")["services"]
FARM = ("scheduler", "worker", "datagen")
DASK = {"scheduler": dask_scheduler, "worker": dask_worker}


def errors(document):
    schema = get_builtin_schema("vendor.compose-spec")
    return [
        error.message for error in validator_for(schema, default=Draft202012Validator)(schema).iter_errors(document)
    ]


@pytest.mark.parametrize("names", [FILES[:1], FILES[1:], FILES], ids="+".join)
def test_is_what_the_compose_specification_allows(names):
    assert errors(load(*names)) == []


@pytest.mark.parametrize("scheme", ["tcp", "tls"])
@pytest.mark.parametrize("name", SERVICES)
def test_commands_accept_what_they_are_given(name, scheme):
    service = load(*FILES, variables={"ZEROSHOT_SCHEME": scheme})["services"][name]
    program, *words = words_of(service)
    if program == "dask":
        role, *words = words
        # dask passes unknown options on to preloaded modules in silence
        known = {flag for parameter in DASK[role].params for flag in parameter.opts}
        assert {word.split("=")[0] for word in words if word.startswith("-")} <= known
        DASK[role].make_context(role, words)
    else:
        {"datagen": datagen, "trainer": trainer}[program].parse_args(words, print_error=False, exit_on_error=False)


@pytest.mark.parametrize("name", SERVICES)
def test_what_is_mounted_is_declared_and_belongs_to_the_user(name):
    service, declared = SERVICES[name], load("compose.yaml")["volumes"]
    made = " ".join(command.value[0] for command in image_of(service).final.commands if command.cmd == "RUN")
    for volume in service.get("volumes", []):
        source, target, *_ = volume.split(":")
        assert source in declared
        # a new volume takes over the owner of the image's folder
        assert f"{target} " in f"{made} ".split("--owner=10001 --group=10001 ", 1)[1].split("&&")[0]


@pytest.mark.parametrize("name", SERVICES)
def test_containers_are_contained(name):
    service = SERVICES[name]
    assert set(service["build"]["args"]) <= set(image_of(service).arguments)
    assert service["read_only"] is True
    assert service["cap_drop"] == ["ALL"]
    assert service["security_opt"] == ["no-new-privileges:true"]
    assert service["pids_limit"] > 0
    assert service["mem_limit"]
    assert not service.get("privileged")
    (tmp,) = service["tmpfs"]
    options = tmp.removeprefix("/tmp:").split(",")
    assert ("exec" in options) == (
        name in FARM
    )  # Docker's default is noexec, and an FMU's library is loaded from there
    assert any(option.startswith("size=") for option in options)


def test_only_the_dashboard_is_published_and_only_on_loopback():
    document = load("compose.yaml")
    assert {name for name, service in SERVICES.items() if service.get("ports")} == {"scheduler"}
    assert SERVICES["scheduler"]["ports"] == ["127.0.0.1:8787:8787"]
    assert document["networks"]["farm"]["internal"] is True
    assert all(SERVICES[name]["networks"] == ["farm"] for name in ("worker", "datagen"))
    assert SERVICES["trainer"]["network_mode"] == "none"


def test_the_scheduler_and_workers_are_set_as_datagen_sets_its_own():
    for name in ("scheduler", "worker"):
        found = dask.config.collect_env(SERVICES[name]["environment"])
        with dask.config.set(dask.config.merge(dask.config.config, found)):
            assert {key: dask.config.get(key) for key in _CONFIG} == _CONFIG


README = (FOLDER / "README.md").read_text()
COMMANDS = [
    shlex.split(line, comments=True)
    for block in re.findall(r"```sh\n(.*?)```", README, re.DOTALL)
    for line in block.splitlines()
]


def test_the_readme_names_variables_that_exist():
    texts = "".join((FOLDER / name).read_text() for name in FILES)
    told = set(re.findall(r"\bZEROSHOT_[A-Z_]+", README))
    used = set(re.findall(r"\$\{(ZEROSHOT_[A-Z_]+):-", texts))
    assert told == used
    defaults = dict(re.findall(r"^\| `(ZEROSHOT_\w+)` \| (\S+) \|", README, re.MULTILINE))
    assert defaults and defaults.items() <= dict(re.findall(r"\$\{(ZEROSHOT_\w+):-([^}]*)\}", texts)).items()


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_the_readme_s_commands_name_what_exists(words):
    for flag, file in pairwise(words):
        if flag == "-f":
            assert (FOLDER.parent / file).is_file()
    if words[:2] == ["docker", "compose"] and words[-1] in FARM:
        assert "up" in words or words[-2] in SERVICES
    for program, command_line in (("datagen", datagen), ("trainer", trainer)):
        # behind the image, the service or the name of the program itself stands its command line
        names = {program, f"zeroshot-{program}"}
        at = [k for k, word in enumerate(words) if word in names]
        if at and words[:2] != ["docker", "build"] and "up" not in words and words[at[-1] + 1 :]:
            command_line.parse_args(words[at[-1] + 1 :], print_error=False, exit_on_error=False)
    if words[0] == "dask":
        role, *rest = words[1:]
        known = {flag for parameter in DASK[role].params for flag in parameter.opts}
        assert {word for word in rest if word.startswith("-")} <= known
    if words[0] == "sh":
        assert (FOLDER.parent / words[1]).is_file()
