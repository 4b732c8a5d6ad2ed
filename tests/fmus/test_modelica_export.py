"""The check of an exported FMU, and the export script: that they pass what is good and fail loudly."""

import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from fmus.modelica import verify
from shared.errors import FmuError, SystemDescriptionError
from shared.system import load_system

RECIPE = Path(__file__).resolve().parents[2] / "fmus" / "modelica"
FMU = RECIPE.parent / "MixedAirCO2.fmu"
ROOM = "for f in TunableRoom.fmu Verification_res.csv; do echo x > $f; done"
OTHERS = "for f in TunableRoomWeatherFile.fmu OriginalExample.fmu; do echo x > $f; done"


@pytest.fixture(scope="module")
def twin_system():
    return load_system(verify.DEFAULT_SYSTEM)


@pytest.fixture(scope="module")
def tool_csv(twin_system, tmp_path_factory):
    """What a tool writes: quoted names, other columns, two rows at an event. Here of the twin."""
    hours = 3600.0 * np.arange(1, 49)
    outputs = verify.simulated(twin_system, float(hours[-1]))
    frame = pd.DataFrame(dict(zip(twin_system.output_names, outputs, strict=True)))
    frame.insert(0, "time", hours)
    frame = pd.concat([frame.iloc[:1].assign(time=0.0), frame.iloc[:10], frame.iloc[9:]])
    path = tmp_path_factory.mktemp("tool") / "Verification_res.csv"
    frame.assign(**{"room.conHea.y": 0.0}).to_csv(path, index=False, quoting=2)
    return path


def test_check_passes_a_good_fmu_and_writes_its_description(tool_csv, tmp_path, capsys):
    (tmp_path / "Room.fmu").write_bytes(FMU.read_bytes())
    words = [tmp_path / "Room.fmu", "--tool", tool_csv, "--write", tmp_path / "system.toml"]
    assert verify.main([str(word) for word in words]) == 0
    assert capsys.readouterr().out.count("ok  ") == 4
    written = load_system(tmp_path / "system.toml")
    assert written.fmu_path == (tmp_path / "Room.fmu").resolve()
    assert written.parameter_names == load_system(verify.DEFAULT_SYSTEM).parameter_names


def test_check_fails_what_differs_from_the_tool(twin_system, tool_csv, tmp_path):
    assert max(verify.differences(twin_system, tool_csv).values()) < 1e-6
    frame = pd.read_csv(tool_csv)
    path = tmp_path / "tool.csv"
    frame.assign(TRoo=frame["TRoo"] + 0.05).to_csv(path, index=False)
    with pytest.raises(FmuError, match=r"TRoo differs from the tool's own simulation by 0.05 K"):
        verify.differences(twin_system, path)
    frame.drop(columns="CO2").to_csv(path, index=False)
    with pytest.raises(FmuError, match="no column 'CO2'"):
        verify.differences(twin_system, path)
    frame.iloc[::5].to_csv(path, index=False)
    with pytest.raises(FmuError, match="not hourly"):
        verify.differences(twin_system, path)


def test_check_fails_dead_parameters_and_broken_files(twin_system, tmp_path, capsys):
    dead = twin_system.parameters[0].model_copy(
        update={"name": "effect.adjacent.T", "unit": "K", "min": 280.0, "max": 300.0}
    )
    with pytest.raises(SystemDescriptionError, match=r"accepts 'effect.adjacent.T' and ignores it"):
        list(verify.verify(twin_system.model_copy(update={"parameters": [*twin_system.parameters, dead]})))
    with pytest.raises(FmuError, match="no such file"):
        list(verify.verify(twin_system.model_copy(update={"fmu": str(tmp_path / "none.fmu")})))
    (tmp_path / "broken.fmu").write_bytes(b"not an archive")
    assert verify.main([str(tmp_path / "broken.fmu")]) == 1
    said = capsys.readouterr().err
    assert said.startswith("FAILED")
    assert "fmpy does not read it" in said


# ---------------------------------------------------------------- the export script fails loudly


@pytest.mark.skipif(sys.platform == "win32", reason="a shell script")
@pytest.mark.parametrize(
    ("fake", "code", "said"),
    [
        (None, 1, "FAILED: no omc on the PATH"),
        ("exit 3", 1, "FAILED: omc ended with code 3"),
        ("echo x > TunableRoom.fmu", 1, "FAILED: omc wrote no Verification_res.csv"),
        (f"{ROOM}; echo x > TunableRoomWeatherFile.fmu", 1, "FAILED: omc wrote no OriginalExample.fmu"),
        (f"{ROOM}; {OTHERS}", 1, "did not reach its end"),
        (f"{ROOM}; {OTHERS}; echo exported", 0, "next: python"),
    ],
)
def test_export_says_what_went_wrong(tmp_path, fake, code, said):
    tools = tmp_path / "tools"
    tools.mkdir()
    if fake is not None:
        omc = tools / "omc"
        omc.write_text(f'#!/bin/sh\n[ "$1" = --version ] && exit 0\n{fake}\n')
        omc.chmod(omc.stat().st_mode | stat.S_IEXEC)
    command = ["sh", str(RECIPE / "export.sh"), str(tmp_path / "build")]
    done = subprocess.run(command, env={"PATH": f"{tools}:/usr/bin:/bin"}, capture_output=True, text=True)
    assert done.returncode == code, done.stdout + done.stderr
    assert said in done.stdout + done.stderr
