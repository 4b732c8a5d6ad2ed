"""Tables of the report, from searches and decisions made up for the purpose."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.gap.reporting import _amplitude, _effects, _values

NAMES = ("one", "two", "three")
EFFECTS = {
    name: SimpleNamespace(name=name, kind="", description="", scale=scale, lower=-100.0, upper=100.0, unit="W")
    for name, scale in zip(NAMES, (1.0, 10.0, 1.0), strict=True)
}


def fitted(**amplitudes):
    """A refit of effects with two parameters before them; amplitudes and standard deviations of 0.1 [scales].

    Amplitudes have a prior of two scales.
    """
    z = np.array([0.0, 0.0, *amplitudes.values()])
    problem = SimpleNamespace(system=SimpleNamespace(parameters=("a", "b")), bounds=(np.full(len(z), -9.0), z + 9.0))
    spread = SimpleNamespace(spread=np.array([1.0, 1.0, *(2.0 for _ in amplitudes)]))
    lin = SimpleNamespace(problem=problem, z=z)
    return SimpleNamespace(names=tuple(amplitudes), lin=lin, sd=np.full(len(z), 0.1), grams=spread)


def told(refits, sets, named, settled=None):
    stage = SimpleNamespace(lin=SimpleNamespace(effects=tuple(EFFECTS.values())))
    decision = SimpleNamespace(probabilities={"one": 0.9, "two": 0.8}, named=named, sets=sets)
    found = _effects(
        SimpleNamespace(refits=refits, settled=settled or [one[0] for one in refits], stages=[stage]),
        decision,
        1.5,
    )
    return {one.name: one for one in found}


def test_effects_that_act_together_have_the_amplitudes_of_the_fit_with_both():
    """Alone, the first had to explain the second's gap as well."""
    refits = [[fitted(one=5.0), fitted(two=3.0)], [fitted(one=2.0, two=0.7), fitted(one=2.5, three=1.0)]]
    found = told(refits, (("one",), ("two",)), ("one", "two"))
    assert (found["one"].amplitude, found["two"].amplitude, found["three"].amplitude) == (2.0, 7.0, 1.0)
    # readings of sd 0.1 beside the prior's 2 say less by 1.5 squared: what Bayes' rule then gives
    half = 1.645 / np.sqrt(1 / 4 + (1 / 0.01 - 1 / 4) / 1.5**2)
    assert found["one"].low == pytest.approx(2.0 - half)
    assert found["two"].high == pytest.approx(7.0 + 10 * half)
    assert [found[name].named for name in NAMES] == [True, True, False]


def test_what_is_told_of_the_chosen_effects_is_of_the_model_that_is_judged():
    """Simulated anew at its optimum, which need not be where its straight line had ended."""
    refits = [[fitted(one=5.0), fitted(two=3.0)]]
    found = told(refits, (("one",),), ("one",), [fitted(one=4.0)])
    assert (found["one"].amplitude, found["two"].amplitude) == (4.0, 30.0)


def test_a_candidate_of_the_first_set_is_as_large_as_it_would_be_in_place_of_the_chosen_one():
    refits = [[fitted(one=5.0), fitted(three=4.0)], [fitted(one=2.0, two=0.7), fitted(one=2.5, three=1.0)]]
    assert told(refits, (("one", "three"), ("two",)), NAMES)["three"].amplitude == 4.0
    assert told(refits, (("one",), ("two", "three")), NAMES)["three"].amplitude == 1.0


@pytest.mark.parametrize(
    ("bounds", "at", "told"),
    [
        ((-8.0, 0.5), -7.7, False),  # a hundredth of the upper bound is no measure of the way from the lower one
        ((-8.0, 0.5), -7.96, True),
        ((0.0, 8.0), 0.05, False),
        ((-8.0, np.inf), -7.95, True),
        ((-np.inf, np.inf), 3.0, False),
    ],
)
def test_an_amplitude_is_on_a_bound_within_a_hundredth_of_its_range(bounds, at, told):
    one = fitted(one=at)
    low, high = (np.array([-9.0, -9.0, bounds[0]]), np.array([9.0, 9.0, bounds[1]]))
    one.lin.problem.bounds = (low, high)
    assert _amplitude(one, "one", 1.5)[2] is told


def test_an_interval_of_a_parameter_is_wider_than_the_recording_says_but_no_wider_than_the_prior():
    """Held against Bayes' rule by hand: a prior of sd 1, and readings whose sd is half as large again."""
    readings = np.array([0.01, 0.5, 1.0, 1e6])
    posterior = 1 / np.sqrt(1 + readings**-2)
    lin = SimpleNamespace(problem=SimpleNamespace(values=lambda z: z), z=np.zeros(4))
    fit = SimpleNamespace(lin=lin, sd=posterior, grams=SimpleNamespace(spread=np.ones(4)))
    low, value, high = _values(fit, 1.5)
    expected = 1.645 / np.sqrt(1 + (1.5 * readings) ** -2)
    np.testing.assert_allclose(high, expected, rtol=1e-9)
    np.testing.assert_allclose(low, -expected, rtol=1e-9)
    np.testing.assert_array_equal(value, 0)
    assert high[0] == pytest.approx(1.5 * 1.645 * posterior[0], rel=1e-3)
