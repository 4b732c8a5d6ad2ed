"""The import as a user calls it: the packaged example from CSV to residuals, and the command."""

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from diagnosis import residuals
from diagnosis.measurements.command import import_
from diagnosis.measurements.importer import import_recording
from diagnosis.recording import read_recording
from shared.console import FAULT, OK, new_app, start
from shared.system import load_system
from tests.diagnosis.measurements.house_cases import HOUSE, MAPPING, ZONE, measured

ROOT = Path(__file__).resolve().parents[3]
OFFICE = ROOT / "fmus" / "MixedAirCO2" / "office.toml"
OFFICE_ROWS = {
    "timestamp": None,
    "bms_temp_in__degC": lambda h: 21 + np.sin(2 * np.pi * h / 24),
    "meter_temp_in__degC": lambda h: 19 + np.sin(2 * np.pi * h / 24),
    "bms_co2__ppm": lambda h: 450 + 300 * ((h % 24 > 9) & (h % 24 < 17)) * (1 - np.exp(-(h % 24 - 9) / 2)),
    "meter_co2__ppm": lambda h: 480 + 10 * np.sin(h),
    "bms_occupancy__bool": lambda h: ((h % 24 > 9) & (h % 24 < 17)).astype(float),
    "bms_valve_frac__0": lambda h: 0.2 + 0.6 * ((h % 24 > 9) & (h % 24 < 17)),
    "temp_out__degC": lambda h: 8 + 3 * np.sin(2 * np.pi * h / 24),
    "wind__m_s_1": lambda h: 3 + np.sin(h),
    "ghi__W_m_2": lambda h: np.maximum(300 * np.sin(2 * np.pi * (h % 24 - 7) / 20), 0) * (h % 24 < 17),
}


def test_the_example_runs_from_csv_to_residuals(tmp_path):
    """The office's own mapping on data of its shape, made here; its FMU in replay with a plausible room."""
    first = datetime(2022, 10, 27, 22, 0, tzinfo=UTC)
    hours = np.arange(0, 6 * 24, 0.25)
    frame = pd.DataFrame({k: f(hours) for k, f in OFFICE_ROWS.items() if f is not None})
    frame.insert(0, "timestamp", [(first + timedelta(hours=h)).astimezone(ZONE).isoformat(sep=" ") for h in hours])
    frame.to_csv(tmp_path / "office.csv", index=False)
    report = import_recording(
        OFFICE.with_name("office-import.toml"), tmp_path / "office.csv", out=tmp_path / "office.nc"
    )
    system = load_system(OFFICE)
    assert report.not_recorded == []
    record = read_recording(report.recording, system)
    assert record.step == 900.0 and set(record.inputs) == set(system.input_names)
    assert record.inputs["mOA_in"].max() == pytest.approx(0.8 * 240 * 1.2 / 3600, rel=1e-6)
    middle = {p.name: float(np.sqrt(p.min * p.max)) for p in system.parameters}
    found = residuals(system, report.recording, parameters=middle, replay=True).outputs
    assert found["TRoo"]["rmse"] < 15 and found["CO2"]["rmse"] < 500
    # the room's air answers to the measured flow: more of it, less CO2
    few = residuals(system, report.recording, parameters={**middle, "gaiCO2.k": 4e-6}, replay=True).outputs
    assert few["CO2"]["bias"] > found["CO2"]["bias"]


def test_the_command(tmp_path, capsys):
    (tmp_path / "house.toml").write_text(HOUSE)
    (tmp_path / "mapping.toml").write_text(MAPPING)
    measured(days=2)[0].to_csv(tmp_path / "data.csv", index=False)
    app = new_app("diagnosis", "")
    app.command(import_, name="import")
    words = ["import", str(tmp_path / "mapping.toml"), str(tmp_path / "data.csv"), "--out", str(tmp_path / "out.nc")]
    assert start(app, words) == OK
    said = capsys.readouterr().out
    assert "UTC+1 h" in said and "columns not used: not mapped" in said and "second meter (room 2): +0.5 K" in said
    assert start(app, [*words, "--json"]) == OK
    assert json.loads(capsys.readouterr().out)["step"] == 1800.0
    assert start(app, [*words[:2], str(tmp_path / "none.csv"), *words[3:]]) == FAULT
    assert "none.csv: no such file" in capsys.readouterr().err
