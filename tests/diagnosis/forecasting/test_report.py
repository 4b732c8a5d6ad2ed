"""What a forecast says first: how far off it was."""

from diagnosis.forecasting.forecasted import Ahead, Forecast
from diagnosis.forecasting.report import answer


def ahead(rmse, covered, unit="K"):
    return Ahead.model_construct(rmse=rmse, covered=covered, unit=unit)


def report(outputs, failed=0):
    return Forecast.model_construct(outputs=outputs, ahead_hours=336.0, level=0.9, draws=40, failed=failed)


def test_a_forecast_says_how_far_off_it_was_and_what_its_band_held():
    names = {"TRoo": "air of the room", "CO2": ""}
    off, held = answer(report({"TRoo": ahead(0.3126, 0.874), "CO2": ahead(12.0, 1.0, "ppm"), "Q": None}), names)
    said = "air of the room (TRoo) by 0.313 K, CO2 by 12 ppm (root mean square)."
    assert off == f"Over the 336 h ahead the forecast was off in {said}"
    assert held.startswith("Its 90% band covered 87% of TRoo, 100% of CO2. It allows for")


def test_where_nothing_was_measured_ahead_none_of_it_is_claimed():
    first, failed = answer(report({"TRoo": None}, failed=3), {})
    assert "the error of the forecast is unknown" in first
    assert failed.startswith("3 of 43 simulations")
