"""NAME=VALUE on a command line is taken at its word, or refused."""

import pytest

from shared.assignments import assignments
from shared.errors import SystemDescriptionError


def test_names_have_their_numbers():
    assert assignments(["a.b=1", " c = -2e3 "]) == {"a.b": 1.0, "c": -2000.0}


@pytest.mark.parametrize(
    ("items", "said"),
    [
        (["a"], "'a': expected NAME=VALUE with a finite number"),
        (["a=b"], "'a=b': expected NAME=VALUE with a finite number"),
        (["a=nan"], "'a=nan': expected NAME=VALUE with a finite number"),
        (["=1"], "'=1': expected NAME=VALUE with a finite number"),
        (["a=1", "b=1", "a =2"], "'a =2': 'a' is given twice; expected one value of it"),
        (["a=b", "c=1", "c=2", "d"], "(?s)'a=b': expected.*'c=2': 'c' is given twice.*'d': expected"),
    ],
)
def test_what_is_no_assignment_is_refused(items, said):
    with pytest.raises(SystemDescriptionError, match=said):
        assignments(items)
