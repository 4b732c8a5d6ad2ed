"""The days after a recording's first ones: :func:`diagnosis.forecasting.forecast.forecast`."""
