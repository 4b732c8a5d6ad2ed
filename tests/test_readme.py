"""Every command in the documentation exists, with the options it is shown with."""

import re
from pathlib import Path

import pytest

from datagen.cli import app as datagen_app
from diagnosis.cli import app as diagnosis_app
from tests.docs.documented import (
    DOCUMENTS,
    ELSEWHERE,
    ROOT,
    by_hand,
    commands,
    first_words,
    matches,
    run_on_pages,
    with_options,
)
from trainer.cli import app as trainer_app

APPS = {"datagen": datagen_app, "trainer": trainer_app, "diagnosis": diagnosis_app}
COMMANDS = [(words, document) for document in DOCUMENTS for words in commands(document)]


@pytest.mark.parametrize(
    ("words", "document"), [pytest.param(*one, id=f"{one[1].name}: {' '.join(one[0])[:60]}") for one in COMMANDS]
)
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


def test_every_command_is_run_in_a_test_or_is_among_those_that_are_run_by_hand():
    """Else nobody would know that it has ceased to do what the document says."""
    table, run = by_hand(), run_on_pages()
    lacking = {
        f"{document.relative_to(ROOT)}: {' '.join(words)}"
        for words, document in COMMANDS
        if with_options(words) not in run and first_words(words) not in ELSEWHERE
        if not any(matches(words, pattern) for pattern in table)
    }
    assert lacking == set(), "run them in tests/docs, or name them in the table of CONTRIBUTING.md"
    assert all(any(matches(words, pattern) for words, _ in COMMANDS) for pattern in table), "of no document any more"
    for needs, last in table.values():
        assert needs and (last == "not noted" or re.fullmatch(r"20\d\d-\d\d-\d\d", last))
    for file, function in ELSEWHERE.values():
        assert re.search(rf"^def {function}\(", (ROOT / "tests" / file).read_text(), re.MULTILINE), function


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_a_document_names_only_files_that_exist(document):
    text = re.sub(r"^```.*?^```", "", document.read_text(), flags=re.MULTILINE | re.DOTALL)
    for name in re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", text):
        assert (document.parent / name).exists(), name
