"""Where limits are kept: what is in the way is said before anything is computed, and nothing of others is replaced."""

import pytest

from datagen.cli import app
from datagen.limits.keeping import ceilings_at
from shared.ceiling import Ceiling, read_ceilings, write_ceilings
from shared.console import FAULT, OK, start

LIMIT = Ceiling(
    context_hours=24.0, step=3600.0, noise="none", channels=["TRoo"], r2={"roo.V": 0.5}, r2_mean=0.5,
    r2_mean_low=None, r2_mean_high=None, systems=1, seed=1,
)  # fmt: skip


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
        ("mine.json", '{"thesis": 1}', "expected a file of `datagen identifiability`"),
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
