import json

import numpy as np
import pytest

from shared.errors import EstimatorError
from trainer.runs.checkpoint import SCHEMA_VERSION, load_run


def change_card(folder, **fields):
    path = folder / "estimator.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | fields))


def test_a_run_comes_back_as_it_was(ridge_run, own_ridge):
    windows = np.random.default_rng(0).uniform(0.5, 4, (3, 48, 1))
    again = load_run(own_ridge)
    assert again.card == ridge_run.card
    assert np.array_equal(again.estimate(windows, np.zeros(3)), ridge_run.estimate(windows, np.zeros(3)))


def test_a_folder_without_a_run_is_told(tmp_path):
    with pytest.raises(EstimatorError, match=r"no such file; expected a run folder made by .* \(MixedAirCO2, Room\)"):
        load_run(tmp_path / "nowhere")


@pytest.mark.parametrize("text", ["", "\x00\x01", "null", "{}"])
def test_a_damaged_card_is_told(own_ridge, text):
    (own_ridge / "estimator.json").write_text(text)
    with pytest.raises(EstimatorError, match=r"estimator.json: (damaged|not valid JSON|schema_version is missing)"):
        load_run(own_ridge)


@pytest.mark.parametrize("version", [SCHEMA_VERSION + 1, True])
def test_a_newer_version_is_told(own_ridge, version):
    change_card(own_ridge, schema_version=version, tricks="new")
    said = rf"schema version is {version!r}; this version of zeroshot-fmu reads up to {SCHEMA_VERSION}: update it"
    with pytest.raises(EstimatorError, match=said):
        load_run(own_ridge)


def test_errors_of_other_parameters_are_named(own_ridge):
    card = json.loads((own_ridge / "estimator.json").read_text())
    card["validation_errors"][0]["rmse"] = {"tank.leak": 1.0}
    change_card(own_ridge, validation_errors=card["validation_errors"])
    sentence = r"validation_errors: has errors of tank\.leak; expected tank\.drain, tank\.fill"
    with pytest.raises(EstimatorError, match=sentence):
        load_run(own_ridge)


def test_a_missing_or_wrong_field_is_named(own_ridge):
    change_card(own_ridge, context_hours="long")
    with pytest.raises(EstimatorError, match="damaged: context_hours"):
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
