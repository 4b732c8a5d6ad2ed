"""Commands that stand in the documents, and how each of them is held: run from its page, elsewhere, or by hand."""

import importlib.util
import re
import shlex
import sys
from fnmatch import fnmatchcase
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = [
    *sorted(ROOT.glob("*.md")),
    *(path for folder in ("docs", "fmus", "docker") for path in sorted((ROOT / folder).rglob("*.md"))),
]
BY_HAND = "## Commands that no test runs\n"
PROGRAMS = ("datagen", "trainer", "diagnosis")

PAGES = (
    "docs/quick-start.md",
    "docs/share.md",
    "docs/own-measurements.md",
    "docs/running.md",
    "docs/own-fmu.md",
    "README.md",
)
"""Pages whose commands are run, in this order and in that in which they stand there."""

ELSEWHERE = {
    "diagnosis app": ("diagnosis/app/test_page.py", "test_a_drifting_sensor_is_named_and_the_report_is_one_file"),
    "diagnosis calibrate": ("diagnosis/calibrating/test_calibration.py", "test_the_command_writes_figures_and_a_page"),
    "diagnosis forecast": ("diagnosis/forecasting/test_forecast.py", "test_the_command_goes_on_from_a_calibration"),
    "diagnosis residuals": ("diagnosis/test_simulated.py", "test_the_command"),
    "diagnosis run": ("diagnosis/gap/test_limits.py", "test_the_command_replays_actuators_which_are_no_evidence_then"),
    "diagnosis blind make": ("diagnosis/blind/test_command.py", "test_command"),
    "diagnosis blind run": ("diagnosis/blind/test_running.py", "test_commands"),
    "diagnosis blind score": ("diagnosis/blind/test_running.py", "test_commands"),
    "trainer benchmark": ("trainer/benchmarking/test_running.py", "test_the_command"),
    "make docs": ("docs/test_site.py", "site"),
    "python ../verify.py": ("fmus/test_modelica_export.py", "test_check_passes_a_good_fmu_and_writes_its_description"),
    "python docs/gallery/forecast.py": ("docs/test_gallery.py", "test_a_forecast_from_a_week"),
    "python docs/gallery/house.py": ("docs/test_gallery.py", "test_a_house_of_my_own"),
    "python docs/making/samples.py": ("docs/test_project.py", "test_the_samples_are_pages_that_stand_alone"),
    "python docs/making/licences.py": ("docs/test_project.py", "test_the_licence_page_is_what_its_script_finds_here"),
    "python tests/docs/plain_english.py": ("docs/test_plain_english.py", "test_the_script_prints_a_line_for_each_page"),
    "python fmus/build.py": ("datagen/comparing/test_comparison.py", "finer"),
}
"""Commands that take a minute, by their first words, and where they are run on smaller things: file and function."""

MOST = {"--systems": 40, "--steps": 2, "--trials": 2, "--windows": 30}
"""Sizes: of so many houses there are four to calibrate a posterior with, and no page shows what comes of them."""
ROOMS = 20
"""So many of the default room, which takes longer to simulate than a house: there are two to evaluate on."""


@cache
def script(name):
    """A script of the documentation, such as ``making/pages``, as a module."""
    path = ROOT / "docs" / f"{name}.py"
    spec = importlib.util.spec_from_file_location(f"docs_{path.stem}", path)
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(path.parent))
        spec.loader.exec_module(module)
    return module


def first_words(words):
    """What tells one command from another: the program, the command, and of the blind check its step."""
    return " ".join(words[: 3 if words[1:2] == ["blind"] else 2])


def in_blocks(text):
    """The commands of a document's blocks, one by one, as words."""
    for block in re.findall(r"```(?:sh|bash|console)\n(.*?)```", text, re.DOTALL):
        for line in block.replace("\\\n", " ").splitlines():
            words = shlex.split(line.removeprefix("$ "), comments=True)
            if words and words[0] in (*PROGRAMS, "make", "python"):
                yield words


def in_sentences(text):
    """Whole commands that stand in a sentence: those that say what they are about, not the bare name of one."""
    for span in re.findall(r"`([^`]+)`", re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)):
        words = re.sub(r"[][]", "", span).split()
        about = words[len(first_words(words).split()) :][:1]
        whole = words[:1] == ["python"] or (words and words[0] in PROGRAMS and about and not about[0].startswith("-"))
        if whole and len(words) > 1:
            yield words


def commands(document):
    """All commands of a document but those that are run by hand; a changelog's are old, a help's have gaps."""
    before, _, after = document.read_text(encoding="utf-8").partition(BY_HAND)
    text = before + after[after.find("\n## ") :] if after else before
    yield from in_blocks(text)
    if document.name not in ("CHANGELOG.md", "commands.md"):
        yield from in_sentences(text)


def by_hand():
    """The table of commands that no test runs: patterns, and for each what it needs and when it was last run."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").partition(BY_HAND)[2]
    rows = [line.strip("| ").split(" | ") for line in text.partition("\n## ")[0].splitlines() if line.startswith("| `")]
    return {pattern: tuple(rest) for cell, *rest in rows for pattern in re.findall(r"`([^`]+)`", cell)}


def matches(words, pattern):
    """Whether a command is one of a pattern's, in which * stands for anything."""
    return fnmatchcase(" ".join(words), pattern.replace("[", "[[]"))


def runs_here(document, words):
    """Whether the tests of the pages run a command."""
    return (
        document.relative_to(ROOT).as_posix() in PAGES
        and words[0] in PROGRAMS
        and first_words(words) not in ELSEWHERE
        and not any(matches(words, pattern) for pattern in by_hand())
    )


def smaller(words):
    """A command with less to do."""
    made, most = words[:1], MOST | ({"--systems": ROOMS} if "MixedAirCO2" in words else {})
    for before, word in pairwise(words):
        if before == "--minutes":
            made[-1:] = ["--steps", str(MOST["--steps"])]
        else:
            made.append(str(min(int(word), most[before])) if before in most else word)
    what = first_words(words)
    if what in ("datagen run", "datagen identifiability") and "--systems" not in words:
        made += ["--systems", "2"]
    if what == "datagen run":
        made += ["--hours", "240"]
    if what == "trainer fit" and "ridge" in words:
        made += ["--steps", str(MOST["--steps"])]
    return [one.replace("fmus/MixedAirCO2", "MixedAirCO2") for one in made]


def with_options(words):
    """What a command is, but for the values that it is given."""
    return first_words(words), frozenset(word for word in words if word.startswith("--"))


def run_on_pages():
    """Every command that the pages run, as :func:`with_options` has it."""
    texts = {ROOT / page: (ROOT / page).read_text(encoding="utf-8") for page in PAGES}
    return {with_options(words) for page, text in texts.items() for words in in_blocks(text) if runs_here(page, words)}
