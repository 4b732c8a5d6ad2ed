"""A training that begins with the weights of an earlier run, on its dataset or another one.

It reads its windows as that one did, and counts as seen what either has seen.
"""

from __future__ import annotations

from typing import Any

from shared.errors import EstimatorError
from shared.logs import logger
from trainer.models import estimator_class
from trainer.models.base import Estimator
from trainer.reading.encoding import LATER, MEASURED, Encoding
from trainer.reading.familiar import of_both
from trainer.runs.checkpoint import Card, Run
from trainer.runs.unfinished import unfinished

_log = logger(__name__)
FREE = {"views", "dropout"}
"""Options that do not say what the weights mean."""


def encoding_of(earlier: Run, own: Encoding) -> Encoding:
    """The encoding of a training that begins with the weights of an earlier run: that one's own.

    Means and standard deviations of the systems at hand may differ from it, for what they are of, and so may which
    channels never varied; the rest may not. Raises EstimatorError if the earlier run encodes its windows in another
    way.
    """
    for field in Encoding.model_fields:
        found, expected = getattr(earlier.card.encoding, field), getattr(own, field)
        if field == "given":  # means and spreads of facts are measured, too
            found, expected = ([(one.name, one.unit, one.log) for one in facts] for facts in (found, expected))
        if field not in MEASURED and found != expected and (found or field not in LATER):
            raise EstimatorError(
                f"begin_with: {earlier.folder}: {field} is {found!r}; expected {expected!r}, as in this training:"
                " give the same channels, contexts and options"
            )
    moving = [name for name in earlier.card.encoding.constant if name in own.recorded and name not in own.constant]
    if moving:
        raise EstimatorError(
            f"begin_with: {earlier.folder}: {', '.join(moving)} never varied in its training; expected a run in whose"
            " training it did, as it does in this one's"
        )
    taken = [*MEASURED, *(["given"] if earlier.card.encoding.given else [])]
    return own.model_copy(update={field: getattr(earlier.card.encoding, field) for field in taken})


def check_same_model(earlier: Run, model: str, options: dict[str, Any], system_hash: str, fmu_sha256: str) -> None:
    """Refuse an earlier run of another description or FMU, and of options that read the same weights otherwise.

    Systems are counted as seen by their root seed and index, which mean the same rooms for one description only. Raises
    EstimatorError if it is such a run, or if a model would be made anew whatever it began with.
    """
    card = earlier.card
    if not estimator_class(model).iterates:
        raise EstimatorError(f"begin_with: {model} is not trained step by step; leave it out")
    if (card.system_hash, card.fmu_sha256) != (system_hash, fmu_sha256):
        raise EstimatorError(
            f"begin_with: {earlier.folder}: is of another system description or FMU ({card.system_hash[:12]},"
            f" {card.fmu_sha256[:12]}); expected the dataset's ({system_hash[:12]}, {fmu_sha256[:12]})"
        )
    for name in sorted((card.options.keys() & options.keys()) - FREE):
        if card.options[name] != options[name]:
            raise EstimatorError(
                f"begin_with: {earlier.folder}: {name} is {card.options[name]!r}; expected {options[name]!r}, as"
                " in this training"
            )


def take_weights(network: Estimator, earlier: Run) -> str:
    """Give a network the weights of an earlier run; returns what identifies them, the sha256 of their file.

    Raises EstimatorError if the earlier run has weights that the network has not.
    """
    if cut_short := unfinished(earlier.card, earlier.folder):
        _log.warning("begin_with: %s: %s", earlier.folder, cut_short)
    own, given = network.state_dict(), earlier.model.state_dict()
    for name, tensor in given.items():
        if name not in own or own[name].shape != tensor.shape:
            raise EstimatorError(
                f"begin_with: {earlier.folder}: {name} has shape {tuple(tensor.shape)};"
                f" expected {tuple(own[name].shape) if name in own else 'no such weights'}"
            )
    network.load_state_dict(own | given)
    return earlier.card.weights_sha256


def take_memory(card: Card, earlier: Card) -> None:
    """Let a card count as seen what the training that it began with had seen as well.

    What the earlier one does not remember is not known of both: which constants were as declared, and what windows of a
    length look like.
    """
    card.training_systems = card.training_systems.with_those(earlier.training_systems)
    card.validation_systems = card.validation_systems.with_those(earlier.validation_systems)
    card.familiar = of_both(earlier.familiar, card.familiar)
    known = earlier.held
    card.held = None if known is None or card.held is None else [name for name in card.held if name in known]
