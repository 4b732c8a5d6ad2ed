import json

import numpy as np
import pytest

from shared.errors import EstimatorError
from trainer.runs.checkpoint import SCHEMA_VERSION, load_run


def test_a_run_comes_back_as_it_was(ridge_run, own_ridge):
    windows = np.random.default_rng(0).uniform(0.5, 4, (3, 48, 1))
    again = load_run(own_ridge)
    assert again.card == ridge_run.card
    assert np.array_equal(again.estimate(windows, np.zeros(3)), ridge_run.estimate(windows, np.zeros(3)))


def test_a_folder_without_a_run_is_told(tmp_path):
    with pytest.raises(EstimatorError, match=r"no such file; expected a run folder made by .* \(MixedAirCO2, Room\)"):
        load_run(tmp_path / "nowhere")


def changed(**fields):
    """A damage to a card: other fields."""
    return lambda text: json.dumps(json.loads(text) | fields)


def of_another_parameter(text):
    card = json.loads(text)
    card["validation_errors"][0]["rmse"] = {"tank.leak": 1.0}
    return json.dumps(card)


NEWER = rf"; this version of zeroshot-fmu reads up to {SCHEMA_VERSION}: update it"


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda _: "", "not valid JSON"),
        (lambda _: "\x00\x01", "not valid JSON"),
        (lambda _: "null", "schema_version is missing"),
        (lambda _: "{}", "schema_version is missing"),
        (changed(schema_version=SCHEMA_VERSION + 1, tricks="new"), rf"version is {SCHEMA_VERSION + 1}{NEWER}"),
        (changed(schema_version=True), f"version is True{NEWER}"),
        (changed(context_hours="long"), "damaged: context_hours"),
        (of_another_parameter, r"validation_errors: has errors of tank\.leak; expected tank\.drain, tank\.fill"),
    ],
)
def test_a_damaged_or_newer_card_is_told(own_ridge, damage, said):
    path = own_ridge / "estimator.json"
    path.write_text(damage(path.read_text()))
    with pytest.raises(EstimatorError, match=rf"estimator\.json: .*{said}"):
        load_run(own_ridge)


def test_damaged_weights_are_told(own_ridge):
    path = own_ridge / "weights.safetensors"
    data = bytearray(path.read_bytes())
    data[-5] ^= 1
    path.write_bytes(data)
    with pytest.raises(EstimatorError, match=r"weights.safetensors: damaged, or not the weights"):
        load_run(own_ridge)
    path.unlink()
    with pytest.raises(EstimatorError, match=r"weights.safetensors: no such file; expected weights"):
        load_run(own_ridge)
