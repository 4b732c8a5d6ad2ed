"""A posterior beside its estimator: ``posterior.safetensors`` and ``posterior.json`` in the run folder. No pickle."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from shared.errors import EstimatorError
from shared.reading import read_json, validated
from trainer.posterior.card import SCHEMA_VERSION, PosteriorCard
from trainer.posterior.flow import PosteriorFlow
from trainer.posterior.inference import Posterior
from trainer.posterior.prior import Prior
from trainer.runs.checkpoint import CALIBRATION, Run
from trainer.runs.pair import digest, write_pair
from trainer.runs.weights import check_card_version, load_weights, weights_data

CARD = "posterior.json"
WEIGHTS = "posterior.safetensors"


def prior_of(run: Run, logarithmic: list[bool]) -> Prior:
    """The prior of a run's parameters."""
    encoding = run.card.encoding
    return Prior(np.array(encoding.parameter_min), np.array(encoding.parameter_max), np.array(logarithmic))


def save_posterior(folder: Path, card: PosteriorCard, flow: PosteriorFlow) -> None:
    """Write weights, and the card that names their hash, which take the place of others at one moment.

    What was found of the others is removed.
    """
    data = weights_data(flow)
    card.weights_sha256 = digest(data)
    write_pair(
        folder / WEIGHTS, data, folder / CARD, card.model_dump_json(indent=1) + "\n", lambda: _remove_findings(folder)
    )


def _remove_findings(folder: Path) -> None:
    for name in CALIBRATION:
        (folder / name).unlink(missing_ok=True)


def load_posterior(run: Run) -> Posterior | None:
    """The posterior in a run's folder; None where there is none.

    Raises EstimatorError if it belongs to another estimator, or a file is damaged or newer than this version.
    """
    if run.folder is None or not (run.folder / CARD).exists():
        return None
    card = _read_card(run.folder / CARD)
    path = run.folder / WEIGHTS
    if card.estimator_sha256 != run.card.weights_sha256:
        raise EstimatorError(
            f"{run.folder / CARD}: was fitted to the estimator {card.estimator_sha256[:12]};"
            f" this one is {run.card.weights_sha256[:12]}: fit the posterior again"
        )
    if len(card.logarithmic) != len(run.card.encoding.parameters):
        raise EstimatorError(
            f"{run.folder / CARD}: has {len(card.logarithmic)} parameters; expected the estimator's"
            f" {len(run.card.encoding.parameters)}: fit the posterior again"
        )
    try:
        flow = load_weights(
            path,
            card.weights_sha256,
            CARD,
            "fit the posterior again",
            lambda: PosteriorFlow(
                len(card.logarithmic), card.context, len(card.lengths), run.card.encoding.outputs, **card.options
            ),
        )
    except EstimatorError:
        if not (run.folder / CARD).exists() or _read_card(run.folder / CARD).weights_sha256 == card.weights_sha256:
            raise
        return load_posterior(run)  # another one has replaced both in between
    return Posterior(run, card, flow, prior_of(run, card.logarithmic))


def check_posterior_not_replaced(posterior: Posterior) -> None:
    """Refuse a posterior in whose run's folder there is another by now.

    Raises EstimatorError if it is so, or the folder holds none any more.
    """
    folder = posterior.run.folder
    if folder is not None and _read_card(folder / CARD).weights_sha256 != posterior.card.weights_sha256:
        raise EstimatorError(f"{folder}: its posterior was replaced while it was at work with; run this again")


def _read_card(path: Path) -> PosteriorCard:
    raw = read_json(path, EstimatorError, "a file of `trainer posterior`; fit the posterior again")
    check_card_version(path, raw, SCHEMA_VERSION, "trainer posterior")
    return validated(PosteriorCard, raw, f"{path}: damaged", EstimatorError)
