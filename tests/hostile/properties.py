"""The property that every reader has, as a test of a family of readers."""

from collections.abc import Callable
from random import Random
from types import ModuleType

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.hostile.trial import Reader, outcome_of, read_whole


def property_of(cases: ModuleType) -> Callable[..., None]:
    """A test: each reader of a family reads its whole file, and reads or refuses every damaged one."""

    @pytest.mark.skipif("sys.platform == 'win32'", reason="limits of time and memory are those of POSIX")
    def test_damaged(tmp_path_factory):
        seen = set()
        for reader in cases.readers(tmp_path_factory.mktemp("hostile") / "files"):
            same = (reader.read, *sorted((path.name, data) for path, data in reader.others.items()))
            if same not in seen:
                read_whole(reader)
            seen.add(same)
            _holds(reader)

    return test_damaged


def _holds(reader: Reader) -> None:
    # the same examples everywhere: new ones are for tests/benchmarks/fuzz.py, whose output somebody looks at
    @settings(max_examples=reader.examples, derandomize=True, suppress_health_check=list(HealthCheck))
    @given(seed=st.integers(0, 2**63))
    def holds(seed):
        said = outcome_of(reader, reader.damage(reader.whole, Random(seed)))
        assert said in ("read", "refused"), f"{reader.name}: {said}"

    holds()
