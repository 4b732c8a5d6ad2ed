"""Why a table of a TOML is refused, in one sentence that says what may have been meant."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from difflib import get_close_matches
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from shared.reading import short, shown


def meant(word: str, names: Iterable[str]) -> str:
    """The end of a sentence about a word that is none of the names: which of them is like it; empty if none is.

    Likeness counts letters as they are written; where none is like it so, in whatever case.
    """
    known = list(names)
    folded = {name.casefold(): name for name in known}
    near = get_close_matches(short(word), known, n=1)
    near = near or [folded[one] for one in get_close_matches(short(word).casefold(), folded, n=1)]
    return f"; did you mean {near[0]}?" if near else ""


def sentence_of(error: ValidationError, model: type[BaseModel]) -> str:
    """The sentence of an error of validating a table by ``model``: its field, what was found, what was expected.

    Of several errors the first; but a field that is like a known one is told before that the known one is missing, and
    where no likeness tells, the unknown field beside the missing one.
    """
    errors = error.errors(include_url=False)
    hints = [_hint(one["loc"], model) if one["type"] == "extra_forbidden" else "" for one in errors]
    k = next((k for k, hint in enumerate(hints) if hint), 0)
    first, hint = errors[k], hints[k]
    where: list[str] = []
    for part in first["loc"]:
        if isinstance(part, int):
            where[-1:] = [f"{where[-1] if where else ''}[{part + 1}]"]
        elif not part.startswith("function-"):
            where.append(part)
    what = first["msg"].removeprefix("Value error, ")
    kind = first["type"]
    if kind == "missing":
        table = first["loc"][:-1]
        beside = [
            f"{one['loc'][-1]}" for one in errors if one["type"] == "extra_forbidden" and one["loc"][:-1] == table
        ]
        what = f"missing; expected a value{f' (found the unknown field {shown(beside[0])})' if beside else ''}"
    elif kind == "extra_forbidden":
        what = f"unknown field (found {shown(first['input'])}){hint}"
    elif kind != "value_error":
        what = f"{what} (found {shown(first['input'])})"
    more = f" (and {error.error_count() - 1} more)" if error.error_count() > 1 else ""
    return f"{short('.'.join(where))}: {short(what)}{more}" if where else f"{short(what)}{more}"


def _hint(where: tuple[int | str, ...], model: type[BaseModel]) -> str:
    """What may have been meant by the unknown field at a place in a table."""
    models = [model]
    for part in where[:-1]:
        kinds = [one for one in models if _tagged(one, part)]
        if len(models) > 1 and kinds:  # of several kinds of tables the one that a tag names, which may be a field's
            models = kinds
        elif inner := [one.model_fields[str(part)].annotation for one in models if part in one.model_fields]:
            models = [each for one in inner for each in _models(one)]
    return meant(str(where[-1]), [name for one in models for name in one.model_fields])


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    """The tables that a field may hold."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for one in get_args(annotation):
        yield from _models(one)


def _tagged(model: type[BaseModel], tag: int | str) -> bool:
    return any(tag in get_args(field.annotation) for field in model.model_fields.values())
