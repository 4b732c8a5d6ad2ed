"""What the farm writes of failures its own reader takes, however many there are and whatever the FMU says."""

from datagen.farming.failures import FILE_NAME, Failures
from shared.reading import MOST_JSON


def test_more_failures_are_read_than_a_file_of_json_has(tmp_path):
    failures = Failures({"root_seed": 1, "system": index, "cause": "c" * 2000} for index in range(3))
    failures.write(tmp_path)
    with open(tmp_path / FILE_NAME, "a") as file:
        file.write((" " * 1000 + "\n") * (MOST_JSON // 1000))
    assert (tmp_path / FILE_NAME).stat().st_size > MOST_JSON
    assert list(Failures.read(tmp_path)) == list(failures)


def test_of_a_long_cause_the_beginning_and_the_end_are_kept(tmp_path):
    cause = "at t = 5 s: " + "the FMU says it once more | " * 10_000 + "the end"
    failures = Failures([{"root_seed": 1, "system": 0, "cause": cause}])
    failures.write(tmp_path)
    (found,) = Failures.read(tmp_path)
    assert len(found["cause"]) < 2000
    assert found["cause"].startswith("at t = 5 s: ") and found["cause"].endswith("the end")
