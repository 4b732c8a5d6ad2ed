"""Room, which describes any single room, and its estimator: intervals that cover rooms nobody has seen."""

import numpy as np
import pytest
import xarray as xr

from datagen import simulate
from datagen.driving.sampling import sample_parameters
from datagen.simulating.drawn import simulate_system
from datagen.simulating.simulator import Simulator
from shared.system import load_system
from tests.datagen.places import sun_worked_out_once  # noqa: F401
from trainer.posterior.checkpoint import load_posterior
from trainer.posterior.inference import summarise
from trainer.predicting.prediction import predict
from trainer.runs.checkpoint import load_run


def test_intervals_cover_rooms_of_another_seed_with_and_without_effects():
    system = load_system("Room").with_experiment(hours=168.0)
    simulator, run = Simulator(system), load_run("Room")
    names = [*system.output_names, *system.input_names]
    windows, stamps, truth = [], [], []
    for index in range(20):
        found = simulate_system(simulator, root_seed=97531, index=index, uncertain=True, disturbed=0.35)
        series = dict(zip(names, np.concatenate([found.outputs, found.inputs]), strict=True))
        windows.append(np.stack([series[name] for name in run.card.encoding.recorded], axis=1))
        stamps.append(found.time[0])
        truth.append(sample_parameters(system, 97531, index))
    said = summarise(load_posterior(run).sample(np.array(windows, dtype=np.float32), np.array(stamps), 100))
    inside = (np.array(truth) >= said.low) & (np.array(truth) <= said.high)
    # 160 intervals of 20 rooms: of 90 % fewer than 80 % would be four standard deviations of independent ones
    assert 0.80 <= inside.mean() <= 0.98
    area = system.parameters[system.parameter_names.index("roo.AFlo")]
    width = np.log(said.high / said.low)[:, system.parameter_names.index("roo.AFlo")]
    assert np.median(width) < 0.55 * np.log(area.max / area.min)  # of 0.9 where nothing is learned


def test_a_recording_brings_its_given_facts_and_a_user_adds_parameters(tmp_path):
    system, week = load_system("Room"), tmp_path / "week.nc"
    simulate("Room", hours=168, seed=13579, out=week)
    with xr.open_dataset(week) as opened:
        facts = {one.name: float(opened[one.name]) for one in system.told}
        area = float(opened["roo.AFlo"])
    told = predict("Room", week, known={"roo.AFlo": area})
    assert told.facts == pytest.approx({"roo.AFlo": area} | facts)
    assert told.predictions[0].parameters["roo.AFlo"].low == pytest.approx(area, rel=1e-5)
