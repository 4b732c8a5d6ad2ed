"""The pages of reference are what the code says, and their examples are ones that it takes."""

import shlex
import tomllib

from diagnosis.measurements.mapping import Mapping
from shared.system import parse_system
from tests.docs.documented import ROOT, script
from tests.test_readme import APPS

reference = script("making/reference")


def test_the_pages_are_what_the_code_says():
    made = reference.pages()
    assert {*made} == {"system.md", "mapping.md", "commands.md"}
    for name, text in made.items():
        assert (ROOT / "docs/reference" / name).read_text(encoding="utf-8") == text, f"{name}: run `make reference`"


def test_every_field_of_a_description_has_a_row():
    """By a walk through the tables of its own, from the top."""
    page = (ROOT / "docs/reference/system.md").read_text(encoding="utf-8")
    sections = {table for _, table, _ in reference.SYSTEM}
    tables, todo = set(), [reference.system.System]
    while todo:
        table = todo.pop()
        tables.add(table)
        for field in table.model_fields.values():
            kinds = [field.annotation]
            while kinds:
                kind = kinds.pop()
                kinds += reference.get_args(kind)
                if isinstance(kind, type) and hasattr(kind, "model_fields") and kind not in tables:
                    todo.append(kind)
    assert tables == sections
    for name in {name for table in tables for name, field in table.model_fields.items() if field.description}:
        assert f"| `{name}` |" in page, name


def test_the_examples_of_a_description_make_one_together(tmp_path):
    parts = [text for heading, _, text in reference.SYSTEM if not heading.startswith("A shape")]
    text = "\n\n".join(parts)
    for name in ("uExc", "open", "HSol"):  # what effects act on
        if f'name = "{name}"' not in text:
            text += f'\n[[inputs]]\nname = "{name}"\nunit = "1"\nsource = "constant"\nvalue = 0.0\n'
    described = parse_system(text, tmp_path / "system.toml")
    assert [one.method for one in described.outputs] == ["point", "mean"]
    shapes = [tomllib.loads(text)["shape"] for heading, _, text in reference.SYSTEM if heading.startswith("A shape")]
    (shaped,) = (one for one in described.effects if one.kind == "shaped")
    for shape in shapes:
        type(shaped).model_validate({**shaped.model_dump(), "shape": shape})


def test_the_examples_of_a_mapping_make_one_together():
    made = Mapping.model_validate(tomllib.loads("\n\n".join(text for _, _, text in reference.MAPPING)))
    assert made.variables["heater"].reading == "mean"


def test_every_command_has_an_example_that_it_takes():
    page = (ROOT / "docs/reference/commands.md").read_text(encoding="utf-8")
    for name, words in reference.EXAMPLES.items():
        assert f"\n{name} {words}\n" in page
        program, *rest = shlex.split(f"{name} {words}")
        APPS[program].parse_args(rest, print_error=False, exit_on_error=False)
    usages = {line.split(" [")[0] for line in page.splitlines() if line.startswith("### ")}
    assert {one.removeprefix("### ") for one in usages} - {"diagnosis blind"} == {*reference.EXAMPLES}
