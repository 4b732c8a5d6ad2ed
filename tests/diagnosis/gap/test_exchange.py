"""The first of two effects asked again beside the second."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.effects.kinds import lagged
from diagnosis.gap import contending, diagnose, exchange
from diagnosis.gap import search as searching
from diagnosis.gap.exchange import ROUNDS, exchanged
from diagnosis.gap.searched import Search
from diagnosis.gap.stages import CLEAR
from tests.diagnosis.gap.gap_cases import candidates, changed

HOURS, HOUR, MONTH = 336, 3600.0, 30 * 86400.0


@pytest.mark.slow
def test_a_wrong_first_choice_does_not_stay(house, house_recorded, tmp_path, monkeypatch):
    """A sensor that is slow and drifts, and a search that would begin with a third cause, as two can look.

    Here fitting afresh puts that right before anything is asked beside the second cause; that an exchange does is held
    by the searches that are made up, below.
    """

    def misled(refits, stage, found, tell):
        if stage is found.stages[0] and len(refits) > 1:
            refits = sorted(refits, key=lambda one: one.names != ("swing",))
        return contending.contended(refits, stage, found, tell)

    monkeypatch.setattr(searching, "contended", misled)
    noise = 0.05 * np.random.default_rng(3).standard_normal(HOURS)
    path = changed(
        house_recorded(tmp_path, hours=HOURS, noise=0.0, seed=3),
        lambda t, y: lagged(y, 3 * HOUR, HOUR) + 4.0 * (t - t[0]) / MONTH + noise,
    )
    told = []
    report = diagnose(house("me"), path, effects=candidates(house("me")), tell=told.append).report
    assert any(one.startswith("looking at what else acts beside") for one in told)
    assert report.verdict == "effect"
    sizes = {one.name: one for one in report.effects if one.named}
    assert sizes.keys() == {"lag", "drift"}
    assert all(one.probability > 0.6 for one in sizes.values())
    # of what was told once where the fit's steps had ended, 1.75 to 2.13 h, the truth is ten standard deviations off
    for name, true in (("lag", 3.0), ("drift", 4.0)):
        one = sizes[name]
        assert abs(one.amplitude - true) < 3 / 1.645 * (one.high - one.amplitude), one


def a_search(*names, worth=0.0):
    """A search that ends with effects, as good as it is worth."""
    chosen = [SimpleNamespace(name=name) for name in names]
    base = SimpleNamespace(lin=SimpleNamespace(chosen=()), discrepant={})
    stages = [
        base,
        *(
            SimpleNamespace(
                lin=SimpleNamespace(chosen=chosen[: k + 1]), discrepant={}, colours=SimpleNamespace(best={})
            )
            for k in range(len(names))
        ),
    ]
    settled = [
        SimpleNamespace(names=names[: k + 1], evidence=worth, evidence_with=lambda _: worth) for k in range(len(names))
    ]
    refits = [[one] for one in settled]
    return Search(stages, SimpleNamespace(), None, refits=refits, settled=settled, tried=refits, simulations=1)


def asked(monkeypatch, found, **answers):
    """The search after an exchange, and which effects were held: ``answers`` by the one that is held."""
    held = []

    def holding(now, effect, *_):
        held.append(effect.name)
        return answers[effect.name]

    monkeypatch.setattr(exchange, "_holding", holding)
    return exchanged(found, (), np.ones((1, 1), dtype=bool), tell=lambda _: None), held


def test_a_better_pair_takes_its_place_and_is_asked_again(monkeypatch):
    """What was found first is weighed where the other one was chosen before it."""
    last = a_search("c", "b", worth=30.0)
    found, held = asked(monkeypatch, a_search("a", "b"), b=a_search("b", "c", worth=30.0), c=last)
    assert held == ["b", "c"]
    assert [one.name for one in found.chosen] == ["b", "c"]
    assert found.beside == {0: (last.stages[1], last.refits[1])}
    assert found.simulations == 3


@pytest.mark.parametrize(("more", "stays"), [(CLEAR - 0.1, True), (CLEAR + 0.1, False)])
def test_what_is_not_clearly_better_changes_nothing(monkeypatch, more, stays):
    first = a_search("a", "b", worth=10.0)
    found, _ = asked(monkeypatch, first, b=a_search("b", "c", worth=10.0 + more), c=a_search("c", "b"))
    assert ([one.name for one in found.chosen] == ["a", "b"]) == stays
    assert (found.beside == {}) == stays


@pytest.mark.parametrize(("worth", "alone"), [(9.9, False), (10.1, True)])
def test_an_effect_that_is_as_good_alone_is_named_alone(monkeypatch, worth, alone):
    found, _ = asked(monkeypatch, a_search("a", "b", worth=10.0), b=a_search("b", worth=worth))
    assert [one.name for one in found.chosen] == (["b"] if alone else ["a", "b"])


def test_exchanges_that_go_round_and_simulations_that_fail_leave_what_was_found(monkeypatch):
    first = a_search("a", "b")
    partner, held = {"a": "b", "b": "c", "c": "a"}, []

    def always_better(now, effect, *_):
        held.append(effect.name)
        return a_search(effect.name, partner[effect.name], worth=10.0 * len(held))

    monkeypatch.setattr(exchange, "_holding", always_better)
    found = exchanged(first, (), np.ones((1, 1), dtype=bool), tell=lambda _: None)
    assert [one.name for one in found.chosen] == ["a", "b"] and len(held) == ROUNDS
    found, _ = asked(monkeypatch, first, b=None)
    assert [one.name for one in found.chosen] == ["a", "b"]


def test_one_effect_is_not_asked(monkeypatch):
    one = a_search("a")
    assert asked(monkeypatch, one)[0] is one


def test_an_effect_that_works_beside_another_only_is_not_held_alone():
    first = a_search("a", "b")
    first.stages[0].lin.effects = [SimpleNamespace(name="a")]
    found = exchanged(first, (), np.ones((1, 1), dtype=bool), tell=lambda _: None)
    assert [one.name for one in found.chosen] == ["a", "b"]


def test_an_effect_that_is_held_is_judged_where_it_was_simulated_anew(monkeypatch):
    """Not where the line of the base model's fit left it."""
    effect = SimpleNamespace(name="b")
    stage = SimpleNamespace(
        lin=SimpleNamespace(effects=[effect], chosen=(), z=np.zeros(1)), colours=SimpleNamespace(best={}), grams=None
    )
    raw, anew = SimpleNamespace(names=("b",), evidence=1.0), SimpleNamespace(names=("b",), evidence=3.0)
    now = Search([stage], SimpleNamespace(), None)
    now.made.refits[now.path, "b"] = raw
    drawn = []
    after = SimpleNamespace(
        lin=SimpleNamespace(chosen=(effect,), z=np.ones(1)), colours=SimpleNamespace(best={}), candidate_found=False
    )
    monkeypatch.setattr(exchange, "contended", lambda refits, *_: (refits, anew))
    monkeypatch.setattr(exchange, "renewed_among", lambda best, *_: drawn.append(best))
    monkeypatch.setattr(exchange, "examine", lambda *_, **__: after)
    found = exchange._holding(now, effect, (), np.ones((1, 1), dtype=bool), 0, lambda _: None)
    assert found.settled == [anew] and drawn == [anew]
    assert found.refits == [[raw]] and found.chosen == (effect,)
