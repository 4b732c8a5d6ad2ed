"""What a user at the shell sees: sentences, exit codes, JSON."""

import json
import subprocess
import sys

import pytest
import xarray as xr

from datagen.cli import app
from shared.console import FAULT, OK, PARTLY, USAGE, start
from shared.store import Manifest
from tests.datagen.faults import stay_in_this_process

RUN = ["run", "TOML", "--out", "x", "--systems", "2"]


def run(*words):
    return start(app, [str(w) for w in words])


def test_simulate_sets_parameters_in_both_spellings(default_system, tmp_path, capsys):
    toml = default_system.path
    assert run("simulate", toml, "--out", tmp_path / "a.nc", "--hours", 24, "--set", "roo.V=100", "roo.AFlo=90") == OK
    words = ["simulate", toml, "--out", tmp_path / "b.nc", "--hours", 24, "--set", "roo.V=100", "--set", "roo.AFlo=90"]
    assert run(*words) == OK
    a, b = (xr.load_dataset(tmp_path / name) for name in ("a.nc", "b.nc"))
    assert float(a["roo.V"]) == 100.0
    assert float(a["roo.AFlo"]) == 90.0
    assert a.identical(b)
    assert "TRoo" in capsys.readouterr().out


def test_farm_commands_work_together(default_system, tmp_path, capsys, monkeypatch):
    stay_in_this_process(monkeypatch)
    folder = tmp_path / "ds"
    words = ["--systems", 2, "--hours", 24, "--workers", 1, "--quiet", "--log", tmp_path / "log.jsonl"]
    assert run("run", default_system.path, "--out", folder, *words) == OK
    assert capsys.readouterr() == ("", "")
    lines = [json.loads(line) for line in (tmp_path / "log.jsonl").read_text().splitlines()]
    assert [line["systems"] for line in lines if line["message"] == "shard shard-000000.nc"] == [[0, 1]]
    assert run("info", folder, "--json") == OK
    found = json.loads(capsys.readouterr().out)
    assert found["systems_done"] == 2
    assert run("verify", folder, "--json") == OK
    assert json.loads(capsys.readouterr().out) == {"folder": str(folder), "ok": True, "faults": []}
    (folder / "shards" / "shard-000000.nc").write_bytes(b"rubbish")
    assert run("verify", folder) == FAULT
    assert "shard-000000.nc" in capsys.readouterr().out


def test_a_dataset_without_some_systems_has_an_exit_code_of_its_own(default_system, tmp_path, capsys, monkeypatch):
    manifest = Manifest(
        **{"system_name": "x", "system_hash": "x", "system": "x", "fmu_sha256": "x", "root_seed": 0, "shard_size": 10},
        **{"systems": 3, "settings": {}, "versions": {}},
    )
    monkeypatch.setattr("datagen.farming.farm.run", lambda *_, **__: manifest)
    assert run("run", default_system.path, "--out", tmp_path / "ds") == PARTLY
    assert "3 failed: see" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["run", "nowhere.toml", "--out", "x", "--systems", "2"], FAULT, "nowhere.toml: no such file"),
        (["simulate", "TOML", "--out", "x.nc", "--set", "roo.V"], FAULT, "expected NAME=VALUE"),
        (["simulate", "TOML", "--out", "x.nc", "--set", "roo.W=3"], FAULT, "'roo.W' is not a parameter"),
        (["simulate", "TOML", "--out", "x.nc", "--hours", "1.5"], FAULT, "does not divide"),
        (["info", "nowhere"], FAULT, "expected a dataset"),
        (["identifiability", "TOML", "--noise", "loud"], FAULT, "'loud' is not a preset"),
        (["run", "TOML", "--out", "x", "--systems", "0"], FAULT, "systems is 0"),
        ([*RUN, "--seed", "-1"], FAULT, "seed is -1; expected at least 0"),
        ([*RUN, "--workers", "0"], FAULT, "workers is 0; expected at least 1"),
        ([*RUN, "--timeout", "0"], FAULT, "timeout is 0 s; expected 0.001 to"),
        ([*RUN, "--shard-size", "0"], FAULT, "shard_size is 0; expected at least 1"),
        ([*RUN, "--hours", "1e300"], FAULT, "hours over step are 1e+300 steps; expected at most 1e+08"),
        (
            [*RUN[:-1], "9999", "--shard-size", "5000"],
            FAULT,
            "5000 systems with 19 channels of 8760 steps are 3176 MiB",
        ),
        ([*RUN, "--failure-budget", "5"], FAULT, "failure_budget is 5; expected a share from 0 to 1"),
        ([*RUN, "--cluster", "slurm"], FAULT, "jobs on other nodes do not reach 127.0.0.1; expected --cluster-option"),
        ([*RUN, "--cluster", "slurp"], FAULT, "cluster is 'slurp'; expected local or slurm"),
        ([*RUN, "--cluster-option", "queue=a"], FAULT, "cluster options queue are given and no cluster; expected"),
        ([*RUN, "--scheduler", "tcp://a:1", "--cluster", "slurm"], FAULT, "and cluster is given; expected one of both"),
        ([*RUN, "--scheduler", "tcp://a:1", "--workers", "2"], FAULT, "and workers is given; expected one of both"),
        (["compare", "TOML", "--recorded", "a.toml", "--hours", "24"], FAULT, "a.toml: hours is given; expected none"),
        (["compare", "TOML", "TOML", "--data", "csv"], FAULT, "data is 'csv' and nothing is recorded; expected both"),
        (["verify", "nowhere", "--system", "TOML"], FAULT, "--system is given without --repair; expected both"),
        (["simulate", "TOML", "--out", "."], FAULT, "'.': is a folder, or has no name; expected the name of a NetCDF"),
        (["simulate", "TOML", "--out", "TOML"], FAULT, "ending is '.toml'; expected .nc"),
        (["simulate", "TOML", "--out", "TOML/x.nc"], FAULT, "nothing can be written there, because"),
        (["simulate", "TOML", "--out", ""], USAGE, "it is empty; expected a path"),
        (["run", "TOML", "--out", "", "--systems", "2"], USAGE, "it is empty; expected a path"),
        (["simulate", "BARE", "--out", "x.nc", "--uncertain"], FAULT, "uncertain is set; expected an [[uncertain]]"),
        (
            ["identifiability", "TOML", "--channels", "TRoo,C02"],
            FAULT,
            "channels ['C02'] are neither outputs nor inputs",
        ),
        (["run", "TOML"], USAGE, "--out"),
        (["fly"], USAGE, "fly"),
    ],
)
def test_each_slip_is_a_sentence(default_system, words, code, said, tmp_path, tmp_path_factory, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    bare = tmp_path_factory.mktemp("bare") / "system.toml"  # without constants that are uncertain
    text = default_system.path.read_text(encoding="utf-8").partition("[[uncertain]]")[0]
    bare.write_text(text.replace('fmu = "', f'fmu = "{default_system.path.parent}/', 1), encoding="utf-8")
    paths = {"TOML": str(default_system.path), "BARE": str(bare)}
    for name, path in paths.items():
        words = [word.replace(name, path) for word in words]
    assert run(*words) == code
    captured = capsys.readouterr()
    assert said in " ".join((captured.err + captured.out).split())
    assert "Traceback" not in captured.err
    assert list(tmp_path.iterdir()) == []


def test_help_is_quick_and_needs_no_simulator():
    code = "import sys; sys.argv = ['datagen', '--help']\n"
    code += "try:\n import datagen.cli as c; c.main()\nexcept SystemExit: pass\n"
    code += "print([m for m in ('numba', 'distributed', 'fmpy') if m in sys.modules])"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert "identifiability" in said
    assert said.strip().endswith("[]")
