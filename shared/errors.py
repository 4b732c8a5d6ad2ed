"""The errors that a user can cause, one small tree.

The command lines print the text and exit with 1, or 3 for :class:`IncompleteError`; what else escapes is a bug of ours.
"""


class ZeroshotError(Exception):
    """Something the user can mend. The text names the file, the field, what was found, what was expected."""


class SystemDescriptionError(ZeroshotError):
    """The system description is wrong, or does not fit its FMU."""


class WeatherError(ZeroshotError):
    """A weather file cannot be read or lacks what is needed."""


class FmuError(ZeroshotError):
    """An FMU cannot be unpacked, loaded or instantiated."""


class SimulationError(ZeroshotError):
    """A simulation failed; the text gives the time, the cause and the FMU's own log."""


class ClusterError(ZeroshotError):
    """Workers cannot be had: a wrong address, another version, a missing package."""


class DatasetError(ZeroshotError):
    """A dataset, a shard or a manifest cannot be used."""


class EstimatorError(ZeroshotError):
    """A training run or a checkpoint cannot be used."""


class OptionsError(EstimatorError):
    """A training with these options of its estimator has no result, but may have one with others."""


class RecordingError(ZeroshotError):
    """A recording cannot be used."""


class TimeUp(ZeroshotError):
    """The time that a command was given is over: it ends with what is known, or with this text if that is nothing."""


class IncompleteError(ZeroshotError):
    """The work is done and written but for a part that failed; the text says how much, and where the causes are."""
