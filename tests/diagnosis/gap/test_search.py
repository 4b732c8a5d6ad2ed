"""What the search tries, and what ends it at once."""

from contextlib import nullcontext
from inspect import signature
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.linalg import LinAlgError

from diagnosis.fitting.failures import NO_TIME, CandidateError
from diagnosis.gap import contending
from diagnosis.gap import search as searching
from diagnosis.gap.contending import UNEXPLAINED
from diagnosis.gap.exchange import exchanged
from diagnosis.gap.made import Made
from diagnosis.gap.search import search
from diagnosis.gap.searched import Search
from shared.errors import SimulationError, TimeUp

COLOURS = SimpleNamespace(best={})


def a_refit(name, evidence):
    lin = SimpleNamespace(amplitudes=[1.0], chosen=(SimpleNamespace(name=name),))
    return SimpleNamespace(names=(name,), evidence=evidence, lin=lin)


@pytest.fixture
def searched(monkeypatch):
    """``searched(before, left, refits, abroad)``: a search in which everything that is simulated is made up.

    ``before``: what the first stage says; ``left``: what is left without a cause after it; ``refits`` of its candidates
    and those ``abroad``, with what all are worth there. The base model's evidence is 10.
    """

    def made(before, left=0.0, refits=(), abroad=((), ()), contended=lambda refits, *_: (refits, refits[0])):
        base = SimpleNamespace(chosen=(), simulations=0, failed={})
        grams = SimpleNamespace(evidence=lambda colours: 10.0)
        first = SimpleNamespace(**before, episodic=False, lin=base, grams=grams, colours=COLOURS)

        def examine(lin, *_, **__):
            after = SimpleNamespace(candidate_found=False, lin=lin, colours=COLOURS, left_over=left)
            return first if lin is base else after

        begun = SimpleNamespace(lin=SimpleNamespace(problem=None), simulations=0, evidence=0.0)
        monkeypatch.setattr(searching, "settled_base", lambda *_, **__: begun)
        monkeypatch.setattr(searching, "applicable", lambda *_: ((), {}))
        monkeypatch.setattr(searching, "among", lambda *_: base)
        monkeypatch.setattr(searching, "examine", examine)
        monkeypatch.setattr(searching, "refitted", lambda *_: [*refits])
        monkeypatch.setattr(searching, "contended", contended)
        monkeypatch.setattr(contending, "laid_bare", lambda *_: None)
        monkeypatch.setattr(searching, "moved", lambda refits, best, *_: ([*refits], best))
        monkeypatch.setattr(searching, "renewed_among", lambda best, *_: best.lin)
        monkeypatch.setattr(searching, "fitted_abroad", lambda *_: looked.append(1) or abroad)
        looked = []
        fit = SimpleNamespace(converged=True, problem=None)
        found = search(fit, (), np.ones((1, 2), dtype=bool), tell=lambda _: None)
        return found, len(looked)

    return made


@pytest.mark.parametrize(
    ("gain", "misfits", "discrepancy", "confirmed"),
    [(2.9, False, False, False), (3.1, False, False, True), (-5.0, True, False, True), (-5.0, False, True, True)],
)
def test_a_refit_confirms_what_a_straight_line_found(searched, gain, misfits, discrepancy, confirmed):
    """And is there a gap as the residual alone says, others are looked at where the fit began."""
    before = {"candidate_found": True, "misfits": misfits, "discrepancy": discrepancy}
    found, looked = searched(before, refits=[a_refit("one", 10.0 + gain)])
    assert found.confirmed == confirmed
    assert [one.name for one in found.chosen] == (["one"] if gain > 3 else [])
    assert looked == (confirmed and gain < 3)


@pytest.mark.parametrize(
    ("gain", "misfits", "named", "confirmed"),
    [(2.9, False, [], False), (2.9, True, ["far"], True), (3.1, False, ["anew"], True), (3.1, True, ["anew"], True)],
)
def test_where_the_way_is_bent_what_is_simulated_anew_has_to_confirm_it(searched, gain, misfits, named, confirmed):
    """Whatever straight lines have promised; of a gap that the residual shows the cause may then be found elsewhere."""
    before = {"candidate_found": True, "misfits": misfits, "discrepancy": False}
    anew, far = [a_refit("anew", 10.0 + gain)], [a_refit("far", 19.0)]
    found, _ = searched(before, refits=[a_refit("one", 50.0)], abroad=(far, []), contended=lambda *_: (anew, anew[0]))
    assert ([one.name for one in found.chosen], found.confirmed) == (named, confirmed)


@pytest.mark.parametrize(
    ("left", "worth", "named", "weighed"),
    [(9.0, 60.0, "near", ["near"]), (11.0, 60.0, "far", ["far", "near"]), (11.0, 40.0, "near", ["near", "far"])],
)
def test_where_a_gap_is_left_candidates_are_looked_at_again(searched, left, worth, named, weighed):
    """And one that is fitted from where the fit began is chosen where it is the more plausible one."""
    before = {"candidate_found": True, "misfits": True, "discrepancy": True}
    near = [a_refit("near", 50.0), a_refit("other", 45.0)]
    found, _ = searched(before, left, near, ([a_refit("far", worth)], ["all"]))
    assert [one.name for one in found.chosen] == [named]
    # what was not simulated anew is no measure beside what was
    assert [one.names[0] for one in found.refits[0]] == (weighed if left > UNEXPLAINED else ["near", "other"])
    assert (found.tried[0] == ["all"]) == (left > UNEXPLAINED)


@pytest.mark.parametrize(
    ("misfits", "discrepancy", "gain", "named"),
    [
        (True, False, 8.5, ["far"]),
        (False, True, 8.5, ["far"]),
        (True, True, 7.5, []),  # twins say nothing of it: only what is plain by itself is chosen
        (False, False, 99.0, []),  # no gap, no search
    ],
)
def test_where_no_candidate_stands_out_of_a_gap_they_are_looked_at_from_where_the_fit_began(
    searched, misfits, discrepancy, gain, named
):
    before = {"candidate_found": False, "misfits": misfits, "discrepancy": discrepancy}
    found, looked = searched(before, 500.0, abroad=([a_refit("far", 10.0 + gain)], []))
    assert [one.name for one in found.chosen] == named
    assert looked == (misfits or discrepancy)


@pytest.mark.parametrize("foremost", [None, 2, 7])
@pytest.mark.parametrize(("best", "near"), [(10.0, 4), (40.0, searching.MOST_REFITS)])
def test_what_stands_out_most_from_its_own_twins_is_refitted_however_much_others_gain(
    monkeypatch, foremost, best, near
):
    """Of a small gap the candidates within eight of the best are, of a large one those with half of its gain."""
    count = 9
    scan = SimpleNamespace(
        order=list(range(count)),
        evidence=np.linspace(best, best - 20.0, count),
        ratio=np.full(count, 30.0),
        foremost=foremost,
    )
    lin = SimpleNamespace(effects=[SimpleNamespace(name=f"effect {j}") for j in range(count)])
    stage = SimpleNamespace(scan=scan, lin=lin, grams=None, colours=SimpleNamespace(best={}))
    monkeypatch.setattr(searching, "linear_start", lambda *_: np.zeros(1))
    made = SimpleNamespace(evidence=1.0, simulations=0, lin=SimpleNamespace(amplitudes=[1.0]))
    tried = []
    monkeypatch.setattr(searching, "refit", lambda grams, best, start, effects: tried.append(effects[0].name) or made)
    searching.refitted(stage, lambda _: None, SimpleNamespace(path="here", made=Made(), simulations=0, failed={}))
    among = list(range(near))
    if foremost == 7:
        among = [*among[: searching.MOST_REFITS - 1], 7]
    assert tried == [f"effect {j}" for j in among]


def test_what_was_made_at_one_optimum_is_not_taken_for_another():
    """An effect that was fitted afresh, and the same one where its refit came to, with fewer candidates beside it."""

    def path(z):
        lin = SimpleNamespace(chosen=(SimpleNamespace(name="one"),), z=np.array(z))
        stage = SimpleNamespace(lin=lin, colours=SimpleNamespace(best={0: (1.0, 0.0, 1.0)}))
        return Search([stage], base=None, plain=None).path

    assert path([0.5, 1.0]) == path([0.5, 1.0])
    assert path([0.5, 1.0]) != path([0.5, 1.1])


@pytest.mark.parametrize(("evidence", "listed"), [(2.0, True), (0.5, False)])
def test_where_another_size_fits_better_it_is_the_best_refit(monkeypatch, evidence, listed):
    """Weighed among the others only if it is more plausible, too; its simulations are counted in any case."""
    first, second = (SimpleNamespace(**vars(a_refit(name, 1.0)), simulations=5) for name in ("one", "two"))
    stage, found = SimpleNamespace(colours=COLOURS), SimpleNamespace(simulations=0)
    same = SimpleNamespace(lin=first.lin, simulations=25)
    other = SimpleNamespace(lin=object(), simulations=25, evidence=evidence)
    monkeypatch.setattr(searching, "elsewhere", lambda *_: same)
    assert searching.moved([first, second], first, stage, found) == ([first, second], first)
    monkeypatch.setattr(searching, "elsewhere", lambda *_: other)
    assert searching.moved([first, second], first, stage, found) == ([other if listed else first, second], other)
    assert found.simulations == 40


@pytest.mark.parametrize(
    ("gain", "there", "settles", "moves"),
    [
        (2.0, 60.0, 17.0, True),  # nothing is plain, and the base model does better there
        (7.5, 60.0, 17.0, True),
        (8.5, 60.0, 17.0, False),  # an effect is
        (2.0, 14.0, 17.0, False),  # no better on the lines
        (2.0, 60.0, 14.0, False),  # nor with lines of its own
        (2.0, 60.0, None, False),  # it cannot be simulated
    ],
)
def test_the_base_model_is_fitted_where_a_refit_shows_that_it_does_better(monkeypatch, gain, there, settles, moves):
    def settled(*_):
        if settles is None:
            raise SimulationError("fails")
        return SimpleNamespace(evidence=settles, simulations=40)

    monkeypatch.setattr(searching, "settled", settled)
    lin = SimpleNamespace(problem=SimpleNamespace(floor=None), z=None, around=None)
    bare = [SimpleNamespace(evidence=value, lin=lin, grams=SimpleNamespace(observed=None)) for value in (11.0, there)]
    stage = SimpleNamespace(grams=SimpleNamespace(evidence=lambda _: 10.0), colours=COLOURS)
    base = SimpleNamespace(evidence=10.0)
    for refits in ([], [[a_refit("one", there + gain)]]):
        found = SimpleNamespace(stages=[stage], refits=refits, bare=bare, base=base, simulations=0)
        moved = moves or (not refits and gain > 8)
        better = searching.better_base(found)
        assert (better is not None) == moved and (better is None or better.evidence == settles)
        assert found.simulations == (40 if moved or settles == 14.0 else 0)


@pytest.mark.parametrize("fails", [False, True])
def test_a_search_begins_again_once_where_the_base_model_does_better(monkeypatch, fails):
    """With nothing left of the first one but what candidates could not be tried, and what it has cost."""
    lin = SimpleNamespace(failed={"broken": "it is stiff"})
    old = Search(["old"], "base", "plain", excluded={"absent": "no such input"}, confirmed=False, simulations=7)
    old.refits, old.settled, old.tried, old.bare = ["refits"], ["settled"], ["tried"], ["bare"]
    followed = []

    def follow(found, *_):
        if fails and followed:
            raise SimulationError("fails")
        followed.append(found)
        return found

    monkeypatch.setattr(searching, "_begun", lambda *_: old)
    monkeypatch.setattr(searching, "_followed", follow)
    monkeypatch.setattr(searching, "better_base", lambda _: "better")
    monkeypatch.setattr(searching, "renewed_among", lambda *_: lin)
    monkeypatch.setattr(searching, "examine", lambda lin, *_, **__: ("stage", lin))
    found = search("fit", (), np.ones((1, 2), dtype=bool))
    if fails:
        assert found is old
        return
    assert (found.stages, found.base, found.confirmed, found.simulations) == ([("stage", lin)], "better", True, 7)
    assert (found.refits, found.settled, found.tried, found.bare) == ([], [], [], [])
    assert found.excluded == {"absent": "no such input", "broken": "it is stiff"}
    assert followed == [old, found] and old.refits == ["refits"]


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
    found = Search([SimpleNamespace(lin=SimpleNamespace(chosen=()))], "base", "plain")
    tries = iter([error, None])

    def extended(*_):
        if (one := next(tries)) is not None:
            raise one
        return False

    monkeypatch.setattr(searching, "_extended", extended)
    assert searching._followed(found, (), np.ones((1, 2), dtype=bool), 0, lambda _: None) is found
    assert (found.failed, found.searched, bool(found.unfinished.why)) == (failed, searched, ends)
    assert next(tries, "none") == (None if ends else "none")


@pytest.mark.parametrize(
    ("errors", "candidates", "why"),
    [
        ([], 2, ""),
        ([LinAlgError("singular")], 2, ""),
        ([LinAlgError("singular"), SimulationError("it is stiff")], 0, "it is stiff"),
        ([TimeUp("no time")], 0, NO_TIME),
    ],
)
def test_a_first_stage_is_made_some_way_and_at_the_last_without_candidates(monkeypatch, errors, candidates, why):
    lifted, left = [], [*errors]

    def examine(lin, *_, **__):
        if left:
            raise left.pop(0)
        return ("stage", lin)

    runner = SimpleNamespace(lifted=lambda: nullcontext(lifted.append(1)))
    base = SimpleNamespace(problem=SimpleNamespace(runner=runner))
    monkeypatch.setattr(searching, "settled_base", lambda *_, **__: "one")
    monkeypatch.setattr(searching, "among", lambda _, effects: len(effects))
    monkeypatch.setattr(searching, "examine", examine)
    found = searching._first_stage(base, ("plug", "bridge"), np.ones((1, 2), dtype=bool), 0)
    assert found == ("one", candidates, ("stage", candidates), why)
    assert bool(lifted) == (why == NO_TIME)


def test_without_a_refit_that_lies_elsewhere_the_base_model_stays():
    assert searching.better_base(SimpleNamespace(bare=[])) is None


@pytest.mark.parametrize("function", [search, exchanged])
def test_nothing_is_said_where_nobody_is_told(function, capsys):
    signature(function).parameters["tell"].default("looking")
    assert capsys.readouterr() == ("", "")


def test_whether_to_go_on_with_the_base_fit_is_asked_of_the_candidates_that_remain(monkeypatch):
    """A gap that only one candidate sees is none without it, and the fit that stopped early is then what is told."""
    both = [SimpleNamespace(name="seer"), SimpleNamespace(name="other")]

    def a_fit(evidence):
        return SimpleNamespace(evidence=evidence, simulations=1, lin=SimpleNamespace(problem=None))

    def linearised(one, effects):
        return SimpleNamespace(of=one, effects=tuple(effects), failed={}, simulations=1, chosen=())

    def examine(lin, *_, **__):
        seen = any(one.name == "seer" for one in lin.effects)
        return SimpleNamespace(candidate_found=False, misfits=False, discrepancy=False, episodic=seen, lin=lin)

    early, late, fits = a_fit(1.0), a_fit(2.0), []
    stopped = SimpleNamespace(converged=False, problem=None, z=None, around=None)
    monkeypatch.setattr(searching, "fit", lambda *_, **__: fits.append(1) or SimpleNamespace(simulations=1))
    monkeypatch.setattr(searching, "settled_base", lambda one, *_, **__: early if one is stopped else late)
    monkeypatch.setattr(searching, "applicable", lambda _, effects: (effects, {}))
    monkeypatch.setattr(searching, "among", linearised)
    monkeypatch.setattr(searching, "fewer", lambda lin, effects, _: linearised(lin.of, effects))
    monkeypatch.setattr(searching, "examine", examine)
    whole = search(stopped, both, np.ones((1, 2), dtype=bool))
    blind = search(stopped, both[1:], np.ones((1, 2), dtype=bool), known=whole)
    seen = search(stopped, both[:1], np.ones((1, 2), dtype=bool), known=whole)
    assert (whole.base, blind.base, seen.base) == (late, early, late)
    assert [one.stages[0].lin.of for one in (whole, blind, seen)] == [late, early, late]
    assert fits == [1]
    assert [one.stages[0].lin.effects for one in (blind, seen)] == [(both[1],), (both[0],)]
