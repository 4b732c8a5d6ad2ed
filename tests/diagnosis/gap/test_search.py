"""What the search tries, and what ends it at once."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.linalg import LinAlgError

from diagnosis.fitting.failures import CandidateError
from diagnosis.gap import search as searching
from diagnosis.gap.evidence import Search
from diagnosis.gap.rivals import Rivals
from diagnosis.gap.search import search
from shared.errors import TimeUp

RUNNER = SimpleNamespace(stage=lambda _: None)


def a_refit(name, evidence, amplitude=1.0):
    lin = SimpleNamespace(amplitudes=[amplitude], z=None)
    return SimpleNamespace(names=(name,) if name else (), evidence=evidence, lin=lin)


@pytest.mark.parametrize(
    ("candidate", "misfits", "at_start", "at_best", "named", "confirmed"),
    [
        (True, False, 3.1, 3.1, ["one", "two"], True),
        (True, False, 2.9, 9.0, [], False),  # strong evidence on one line only
        (True, False, 9.0, 2.9, [], False),
        (True, True, 9.0, 2.9, [], True),  # a gap, whatever its cause
        (False, True, 9.0, 9.0, ["one", "two"], True),
        (False, False, 99.0, 99.0, [], True),  # nothing stands out: nobody is asked
    ],
)
def test_the_best_has_to_be_strong_evidence_where_the_fit_began_and_where_it_is(
    monkeypatch, candidate, misfits, at_start, at_best, named, confirmed
):
    """Over the base model on the same line each time; what is negligible is no candidate."""
    asked = []

    def at_the_start(*_):
        asked.append("start")
        ones = [a_refit("one", 10.0 + at_start), a_refit("two", 11.0), a_refit("none", 10.5), a_refit("far", -90.0)]
        return Rivals(a_refit("", 10.0), tuple(ones), {"three": "it is stiff"})

    def at_the_best(rivals, *_):
        asked.append([one.names[0] for one in rivals.refits])
        best = a_refit("one", -40.0 + at_best)
        return Rivals(a_refit("", -40.0), (best, a_refit("two", -60.0), a_refit("none", -70.0, 0.01)))

    monkeypatch.setattr(searching, "from_one_start", at_the_start)
    monkeypatch.setattr(searching, "on_the_best_line", at_the_best)
    effects = [SimpleNamespace(name=name) for name in ("one", "two", "three", "none", "far")]
    stage = SimpleNamespace(
        lin=SimpleNamespace(effects=effects, z=None, chosen=()),
        scan=SimpleNamespace(order=[4, 0, 1, 2, 3], ratio=np.ones(5)),
        grams=SimpleNamespace(observed=None),
        colours=SimpleNamespace(best={}),
        **{"discrepancy": False, "candidate_found": candidate, "misfits": misfits, "differs": candidate or misfits},
    )
    base = SimpleNamespace(lin=SimpleNamespace(problem=SimpleNamespace(runner=RUNNER)))
    found = Search([stage], base=base, line="line")
    monkeypatch.setattr(Search, "path", "here")
    assert [one.names[0] for one in searching._first_effect(found)] == named
    assert found.confirmed == confirmed
    # far behind, but the first on the straight line at the base model's fit
    assert asked == (["start", ["one", "two", "none", "far"]] if candidate or misfits else [])
    assert found.failed == ({"three": "it is stiff"} if asked else {})


@pytest.mark.parametrize(
    ("error", "ends", "failed", "searched"),
    [
        (CandidateError("plug", "it is stiff"), False, {"plug": "it is stiff"}, True),
        (LinAlgError("1-th leading minor"), True, {}, False),
        (TimeUp("no time"), True, {}, False),
    ],
)
def test_a_search_goes_on_without_a_candidate_that_fails_and_ends_with_what_it_has(
    monkeypatch, error, ends, failed, searched
):
    """A failure of nobody's in particular, and the end of the time, end it; the answer says what it lacks."""
    found = Search([SimpleNamespace(lin=SimpleNamespace(chosen=()))], "base", "line")
    tries = iter([error, None])

    def extended(*_):
        if (one := next(tries)) is not None:
            raise one
        return False

    monkeypatch.setattr(searching, "_extended", extended)
    monkeypatch.setattr(searching, "_begun", lambda *_: found)
    assert search(None, (), np.ones((1, 2), dtype=bool)) is found
    assert (found.failed, found.searched, bool(found.unfinished.why)) == (failed, searched, ends)
    assert next(tries, "none") == (None if ends else "none")
