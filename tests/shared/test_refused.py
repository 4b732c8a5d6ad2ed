"""What may have been meant by a field that is not known."""

from typing import Annotated, Literal

import pytest
from pydantic import Field, ValidationError

from shared.refused import meant, sentence_of
from shared.signals import Table


class Round(Table):
    kind: Literal["round"]
    radius: float = 1.0


class Square(Table):
    kind: Literal["square"]
    ratio: float = 1.0
    inner: dict[str, Round] = {}


class Shapes(Table):
    shapes: list[Annotated[Round | Square, Field(discriminator="kind")]]
    title: str = ""


def test_the_nearest_name_is_meant_or_none():
    assert meant("CO_2", ["CO2Out", "CO2"]) == "; did you mean CO2?"
    assert meant("wind", ["CO2Out", "CO2"]) == ""
    assert meant("ROOM", ["Room", "Roof"]) == "; did you mean Room?"


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"shape": []}, r"^shape: unknown field \(found \[\]\); did you mean shapes\? \(and 1 more\)$"),
        ({"weight": 1}, r"^shapes: missing; expected a value \(found the unknown field 'weight'\) \(and 1 more\)$"),
        ({}, r"^shapes: missing; expected a value$"),
        ({"shapes": [{"kind": "square", "ratios": 2.0}]}, r"ratios: unknown field .*; did you mean ratio\?$"),
        # a field of another kind of table is not meant
        ({"shapes": [{"kind": "square", "radus": 2.0}]}, r"radus: unknown field \(found 2.0\)$"),
        (
            {"shapes": [{"kind": "square", "inner": {"a": {"kind": "round", "radus": 1}}}]},
            r"inner.a.radus: unknown field .*; did you mean radius\?$",
        ),
    ],
)
def test_what_was_meant_is_of_the_table_that_it_stands_in(given, said):
    with pytest.raises(ValidationError) as caught:
        Shapes.model_validate(given)
    with pytest.raises(ValueError, match=said):
        raise ValueError(sentence_of(caught.value, Shapes))
