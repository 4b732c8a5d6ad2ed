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
    *sorted(ROOT.glob("*.md")),
    *(path for folder in ("docs", "fmus", "docker") for path in sorted((ROOT / folder).rglob("*.md"))),
]


def commands():
    for document in DOCUMENTS:
        for block in re.findall(r"```(?:sh|bash|console)\n(.*?)```", document.read_text(), re.DOTALL):
            for line in block.replace("\\\n", " ").splitlines():
                words = shlex.split(line.removeprefix("$ "), comments=True)
                if words and words[0] in (*APPS, "make", "python"):
                    yield pytest.param(words, document, id=f"{document.name}: {' '.join(words)[:60]}")


@pytest.mark.parametrize(("words", "document"), list(commands()))
def test_documented_command_exists(words, document):
    if words[0] == "make":
        targets = re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
        assert words[1] in targets
        return
    if words[0] == "python":
        beside = document.parent / Path(words[1]).name  # a recipe may go into a folder of its own first
        assert (ROOT / words[1]).is_file() or beside.is_file()
        return
    APPS[words[0]].parse_args(words[1:], print_error=False, exit_on_error=False)


def test_there_are_commands_to_check():
    assert len(list(commands())) >= 8


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_a_document_names_only_files_that_exist(document):
    text = re.sub(r"^```.*?^```", "", document.read_text(), flags=re.MULTILINE | re.DOTALL)
    for name in re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", text):
        assert (document.parent / name).exists(), name
