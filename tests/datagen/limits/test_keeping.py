"""Where limits are kept: what is in the way is said before anything is computed, and nothing of others is replaced."""

import pytest

from datagen.cli import app
from datagen.limits.keeping import ceilings_at
from shared.ceiling import Ceiling, Origin, read_ceilings, write_ceilings
from shared.console import FAULT, OK, start

LIMIT = Ceiling(
    context_hours=24.0,
    step=3600.0,
    noise="none",
    channels=["TRoo"],
    r2={"roo.V": 0.5},
    r2_mean=0.5,
    r2_mean_low=None,
    r2_mean_high=None,
    systems=1,
    seed=1,
)


@pytest.fixture
def asked(default_system, monkeypatch, capsys):
    """``asked(*words)``: exit code and sentence of the command, and how often it went to work."""
    done = []
    limit = LIMIT.model_copy(update={"r2": dict.fromkeys(default_system.parameter_names, 0.5)})
    monkeypatch.setattr("datagen.limits.ceilings.ceilings_of", lambda *_, **__: done.append(1) or [limit])
    monkeypatch.setattr("datagen.simulating.liveness.check_live_apart", lambda *_, **__: done.append(1))

    def ask(*words):
        code = start(app, ["identifiability", str(default_system.path), "--systems", "1", *map(str, words)])
        return code, " ".join("".join(capsys.readouterr()).split()), len(done)

    return ask


@pytest.mark.parametrize(
    ("name", "holds", "said"),
    [
        ("nowhere/limit.json", None, "limit.json: cannot be written (No such file or directory); expected a file in a"),
        ("file/limit.json", None, "limit.json: cannot be written (Not a directory); expected a file in a"),
        ("mine.json", '{"thesis": 1}', "expected a file of `datagen identifiability`"),
        ("mine.json", "words", "expected a file of `datagen identifiability`"),
        ("", None, "it is a folder; expected a file of `datagen identifiability`"),
    ],
)
def test_what_is_in_the_way_is_said_before_any_work(asked, tmp_path, name, holds, said):
    (tmp_path / "file").write_text("a")
    if holds is not None:
        (tmp_path / name).write_text(holds)
    before = sorted(path.name for path in tmp_path.iterdir())
    code, text, work = asked("--out", tmp_path / name)
    assert (code, work) == (FAULT, 0)
    assert said in text
    assert sorted(path.name for path in tmp_path.iterdir()) == before
    assert holds is None or (tmp_path / name).read_text() == holds


@pytest.mark.parametrize("field", ["system_hash", "fmu_sha256"])
def test_limits_of_another_system_are_replaced_only_where_that_is_asked_for(asked, default_system, tmp_path, field):
    path = tmp_path / "limit.json"
    own = ceilings_at(path, default_system)
    assert own.ceilings == []
    other = own.model_copy(update={"system_name": "House", field: "f" * 64, "ceilings": [LIMIT]})
    write_ceilings(path, other)
    code, text, work = asked("--out", path)
    assert (code, work) == (FAULT, 0)
    assert f"holds limits of House whose {field} is ffffffffffff, that of {default_system.path}" in text
    assert read_ceilings(path) == other
    assert asked("--out", path, "--overwrite")[0] == OK
    found = read_ceilings(path)
    assert (found.system_hash, found.fmu_sha256, len(found.ceilings)) == (own.system_hash, own.fmu_sha256, 1)


def test_limits_of_the_same_system_are_added_to(asked, default_system, tmp_path):
    path = tmp_path / "limit.json"
    day = LIMIT.model_copy(update={"context_hours": 48.0})
    write_ceilings(path, ceilings_at(path, default_system).model_copy(update={"ceilings": [day]}))
    code, text, _ = asked("--out", path)
    assert code == OK
    assert "mean 0.500 of one system there is no interval kept in" in text
    assert [one.context_hours for one in read_ceilings(path).ceilings] == [48.0, 24.0]


def test_a_limit_of_more_systems_is_replaced_only_where_that_is_asked_for(asked, default_system, tmp_path):
    path = tmp_path / "limit.json"
    own = ceilings_at(path, default_system)
    origin = Origin(start=default_system.experiment.start, hours=default_system.experiment.hours)
    many = LIMIT.model_copy(update={"systems": 20, "origin": origin})
    write_ceilings(path, own.model_copy(update={"ceilings": [many]}))
    words = ["--out", path, "--context", 24, "--channels", "TRoo"]
    code, text, work = asked(*words)
    assert (code, work) == (FAULT, 0)
    assert "holds a limit for 24 h of TRoo with noise none over 20 systems, and this one is over 1; expected" in text
    assert read_ceilings(path).ceilings == [many]
    assert asked("--out", path, "--context", 48, "--channels", "TRoo")[0] == OK  # another condition
    assert asked(*words, "--overwrite")[0] == OK
    assert [one.systems for one in read_ceilings(path).ceilings if one.context_hours == 24] == [1]


def test_limits_that_come_with_the_package_are_not_written_over(monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("datagen.limits.ceilings.ceilings_of", lambda *_, **__: pytest.fail("computed"))
    assert start(app, ["identifiability", "MixedAirCO2", "--systems", "1"]) == FAULT
    assert "MixedAirCO2: comes with the package, and so do its limits" in capsys.readouterr().err


def test_sets_of_one_channel_each_are_told(asked, tmp_path):
    out = ("--out", tmp_path / "limit.json")
    _, text, _ = asked(*out, "--channels", "TRoo", "CO2")
    assert "2 sets of one channel each; TRoo,CO2 would be one set of all" in text
    assert "one channel each" not in asked(*out, "--channels", "TRoo,CO2", "CO2")[1]
