"""From a recording to parameters with their uncertainty: :func:`diagnosis.calibrating.calibration.calibrate`."""
