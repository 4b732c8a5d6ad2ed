"""A training that begins with the weights of an earlier run, on its dataset or another one.

It reads its windows as that one did, and counts as seen what either has seen.
"""

from __future__ import annotations

from shared.errors import EstimatorError
from trainer.checkpoint import Run
from trainer.encoding import LATER, MEASURED, Encoding
from trainer.models.base import Estimator


def encoding_of(earlier: Run, own: Encoding) -> Encoding:
    """The encoding of a training that begins with the weights of an earlier run: that one's own.

    Means and standard deviations of the systems at hand may differ from it, for what they are of; the rest may not.

    Raises
    ------
    EstimatorError
        If the earlier run encodes its windows in another way.
    """
    for field in Encoding.model_fields:
        found, expected = getattr(earlier.card.encoding, field), getattr(own, field)
        if field not in MEASURED and found != expected and (found or field not in LATER):
            raise EstimatorError(
                f"begin_with: {earlier.folder}: {field} is {found!r}; expected {expected!r}, as in this training:"
                " give the same dataset, channels and contexts"
            )
    return own.model_copy(update={field: getattr(earlier.card.encoding, field) for field in MEASURED})


def take_weights(network: Estimator, earlier: Run) -> str:
    """Give a network the weights of an earlier run; returns what identifies them, the sha256 of their file.

    Raises
    ------
    EstimatorError
        If the earlier run has weights that the network has not.
    """
    own, given = network.state_dict(), earlier.model.state_dict()
    for name, tensor in given.items():
        if name not in own or own[name].shape != tensor.shape:
            raise EstimatorError(
                f"begin_with: {earlier.folder}: {name} has shape {tuple(tensor.shape)};"
                f" expected {tuple(own[name].shape) if name in own else 'no such weights'}"
            )
    network.load_state_dict(own | given)
    return earlier.card.weights_sha256
