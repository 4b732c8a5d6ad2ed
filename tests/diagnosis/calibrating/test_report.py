"""The pictures of a calibration's page."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.calibrating.report import _inputs, sentences
from diagnosis.calibrating.schema import Constant


def test_what_lies_at_an_end_of_its_range_is_not_said_to_be_the_prior(calibrated):
    """Hardly told by its variance, and yet moved: the range's end made the interval."""
    ranges = [
        one.model_copy(update={"identified": "hardly", "at_bound": k == 0})
        for k, one in enumerate(calibrated.report.parameters)
    ]
    z = [3.0, 2.0, 0.1, *calibrated.report.z[3:]]
    names = [one.name for one in ranges]
    report = calibrated.report.model_copy(update={"parameters": ranges, "z": z, "converged": True})
    said = sentences(report)
    assert f"It pushes {names[1]} to an end of the range: the interval ends where the range does." in said
    others = ", ".join(name for name, place in zip(names[2:], z[2:], strict=False) if abs(place) < 1.28)
    assert f"It hardly identifies {others}: what is given for them is mostly the prior." in said
    assert any(one.startswith(f"{names[0]} lies on a bound") for one in said)
    wider = sentences(report.model_copy(update={"wider": "Room", "recording": "week.nc"}))
    assert [one for one in wider if one not in said] == ["Room has wider ranges: diagnosis calibrate Room week.nc"]
    said = sentences(report.model_copy(update={"converged": False}))
    assert any(one.startswith("The fit had not converged") for one in said)


def test_uncertain_constants_far_outside_of_the_description_come_first(calibrated):
    """Three and two thirds of a standard deviation of 0.3 make x3."""
    well = [p.model_copy(update={"at_bound": False, "identified": "well"}) for p in calibrated.report.parameters]
    report = calibrated.report.model_copy(update={"parameters": well})

    def told(*places):
        ones = [
            Constant(name=name, description="", factor=float(np.exp(0.3 * place)), low=0.1, high=9.0)
            for name, place in zip(("floor", "wall"), places, strict=True)
        ]
        z = [*report.z[: len(report.parameters)], *places]
        return sentences(report.model_copy(update={"constants": ones, "z": z}))

    within = told(1.9, 0.0)
    assert any(one.startswith("The recording identifies ro") and one.endswith(" well.") for one in within)
    assert not any("far outside" in one for one in within)
    for places, far in (
        ((11 / 3, -1.9), "floor x3 (expected: x0.55 to x1.8)"),
        ((0.0, -2.5), "wall x0.47 (expected: "),
    ):
        first, second, *_ = told(*places)
        assert first.startswith(far) and "is far outside of what the description expects" in first
        assert second.startswith("Only with such constants does the recording identify ro") and "well" not in second


def test_what_is_left_is_held_against_the_declared_noise(calibrated):
    """A fit that found much noise has no more room for what is slow: the sensor has not become worse by it."""
    report = calibrated.report
    name, one = next((name, one) for name, one in report.outputs.items() if one.used)

    def told(undeclared=(), **noise):
        channel = one.model_copy(update={"declared": 0.1, **noise})
        return " ".join(
            sentences(
                report.model_copy(update={"outputs": {name: channel}, "undeclared": dict.fromkeys(undeclared, "0.1 K")})
            )
        )

    slow, rough = f"The residual of {name} is slow", f"The residual of {name} (0.3"
    assert slow not in told(noise=0.1, slow_noise=0.09) and rough not in told(noise=0.12, slow_noise=0.0)
    assert f"{rough}, declared 0.1) scatters" in told(noise=0.3, slow_noise=0.2, unit="1")
    assert f"The residual of {name} (1230 W, declared 100)" in told(
        noise=1234.0, declared=100.0, slow_noise=0, unit="W"
    )
    both = told(noise=0.3, slow_noise=0.2)
    assert slow in both and rough in both and "declared 0.1) scatters from reading to reading" in both
    none = told((name,), noise=0.3, slow_noise=0.2)
    assert slow not in none and rough not in none
    assert slow in told((name,), noise=0.3, slow_noise=0.4)


@pytest.mark.parametrize("inputs", [[], ["ambient"]])
def test_inputs_of_which_none_moves_have_no_picture(inputs):
    """A tank in a room whose temperature stays, whose persons were counted, or which has no inputs at all."""
    problem = SimpleNamespace(
        system=SimpleNamespace(inputs=[SimpleNamespace(name=name, source="weather", unit="K") for name in inputs]),
        drive=SimpleNamespace(start=0.0, signals={name: SimpleNamespace(at=np.zeros_like) for name in inputs}),
        recording=SimpleNamespace(zero=np.datetime64("2001-01-01"), step=3600.0),
        time=3600.0 * np.arange(1, 25),
        nuisance=SimpleNamespace(levels=()),
        size=0,
        values=np.asarray,
    )
    assert _inputs(SimpleNamespace(problem=problem, fit=SimpleNamespace(z=np.empty(0)))) == ([], [])
