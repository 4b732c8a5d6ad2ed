"""The project's papers: README, citation, changelog, licences."""

import ast
import importlib
import inspect
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import yaml

from diagnosis import read_report
from shared import __version__
from tests.docs.documented import ROOT, script

PACKAGES = ("shared", "datagen", "trainer", "diagnosis")


def test_the_citation_file_keeps_its_schema_and_names_this_version():
    words = ["check_jsonschema", "--builtin-schema", "vendor.citation-file-format", "CITATION.cff"]
    done = subprocess.run([sys.executable, "-m", *words], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert cited["version"] == __version__
    (paper,) = cited["references"]
    assert paper["title"] in " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())


def test_the_python_of_the_readme_calls_functions_with_arguments_that_they_have():
    (block,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    calls = [one for one in ast.walk(ast.parse(block)) if isinstance(one, ast.Call)]
    ours = {ast.unparse(one.func): one for one in calls if ast.unparse(one.func).split(".")[0] in PACKAGES}
    assert {*ours} == {"datagen.simulate", "trainer.predict", "diagnosis.calibrate", "diagnosis.diagnose"}
    for name, call in ours.items():
        package, function = name.split(".")
        signature = inspect.signature(getattr(importlib.import_module(package), function))
        signature.bind(*call.args, **{one.arg: one.value for one in call.keywords})


def test_the_changelog_has_this_version_and_only_kinds_of_change_that_keep_a_changelog_knows():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.search(rf"^## \[{re.escape(__version__)}\] - \d{{4}}-\d\d-\d\d$", text, re.MULTILINE)
    kinds = set(re.findall(r"^### (.+)$", text, re.MULTILINE))
    assert kinds <= {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}


def test_the_licence_page_is_what_its_script_finds_here():
    """Names only: which packages come along is a matter of versions, their licence texts too."""
    licences, rows = script("making/licences"), {}
    for line in (ROOT / "docs/licences.md").read_text(encoding="utf-8").splitlines():
        if line.startswith("| "):
            name, licence, *marks = (cell.strip() for cell in line.strip("|").split("|"))
            rows[name] = (licence, marks)
    _, extras = rows.pop("package")
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    assert {*extras} == {*declared, "(none)"} - {"dev"} and len(extras) == len(licences.EXTRAS)
    for extra in licences.EXTRAS:
        for name in licences.needed(extra):
            licence, marks = rows.get(name, ("", []))
            assert licence and not licence.startswith("not stated"), f"{name}: run python docs/making/licences.py"
            assert marks[extras.index(extra or "(none)")] == "x", f"{name} of {extra}"


def test_no_name_of_the_default_room_is_in_the_packages(default_system):
    """Of those that are no words of English, by their letters: an example would be taken for a rule."""
    names = {*default_system.parameter_names, *default_system.input_names, *default_system.output_names}
    strange = {name for name in names if re.search("[a-z][A-Z]|[A-Z]{2}[a-z]|^[A-Z][A-Z]?[a-z]", name)}
    assert len(strange) > len(names) / 2
    word = re.compile(rf"\b({'|'.join(map(re.escape, sorted(strange)))})\b")
    found = [
        f"{path.relative_to(ROOT)}: {match[0]}"
        for package in PACKAGES
        for path in sorted((ROOT / package).rglob("*.py"))
        for match in word.finditer(path.read_text(encoding="utf-8"))
    ]
    assert found == []


def test_the_demo_is_a_program_of_the_checkout():
    """Its help is told where the packages are installed, with the file that ``make demo`` names."""
    (line,) = [one for one in (ROOT / "Makefile").read_text(encoding="utf-8").splitlines() if "demo.py" in one]
    words = [sys.executable, line.split()[1], "--help"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": str(ROOT)})
    assert done.returncode == 0 and "--systems" in done.stdout, done.stderr


def test_the_samples_are_pages_that_stand_alone():
    folder = ROOT / "docs/samples"
    assert {one.stem for one in folder.glob("*.html")} == {"effect", "none_of_these", "no_gap", "forecast"}
    for path in folder.glob("*.html"):
        page = path.read_text(encoding="utf-8")
        assert len(page) < 2_500_000 and "data:image/png;base64," in page
        outside = re.sub("<script>.*?</script>", "", page, flags=re.S)
        assert not re.findall(r"""<script|(?:src|href)=["'](?!data:|#)""", outside), path.name
        assert "/tmp/" not in page and str(Path.home()) not in page, path.name
    assert read_report(folder / "effect.json").verdict == "effect"
