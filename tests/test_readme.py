"""Every command in the documentation exists, with the options it is shown with."""

import re
import shlex
from pathlib import Path

import pytest

from datagen.cli import app as datagen_app
from diagnosis.cli import app as diagnosis_app
from trainer.cli import app as trainer_app

ROOT = Path(__file__).resolve().parents[1]
APPS = {"datagen": datagen_app, "trainer": trainer_app, "diagnosis": diagnosis_app}
DOCUMENTS = [
    ROOT / "README.md",
    *(path for folder in ("docs", "fmus", "docker") for path in sorted((ROOT / folder).rglob("*.md"))),
]


def commands():
    for document in DOCUMENTS:
        for block in re.findall(r"```(?:sh|bash|console)\n(.*?)```", document.read_text(), re.DOTALL):
            for line in block.replace("\\\n", " ").splitlines():
                words = shlex.split(line.removeprefix("$ "), comments=True)
                if words and words[0] in (*APPS, "make"):
                    yield pytest.param(words, id=f"{document.name}: {' '.join(words)[:60]}")


@pytest.mark.parametrize("words", list(commands()))
def test_documented_command_exists(words):
    if words[0] == "make":
        targets = re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
        assert words[1] in targets
        return
    APPS[words[0]].parse_args(words[1:], print_error=False, exit_on_error=False)


def test_there_are_commands_to_check():
    assert len(list(commands())) >= 8


def test_the_readme_names_only_files_that_exist():
    for name in re.findall(r"\]\(([^)#:]+)\)", (ROOT / "README.md").read_text()):
        assert (ROOT / name).exists(), name
