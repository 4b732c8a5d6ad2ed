"""A verdict file that is made up."""

from diagnosis.verdicts import Answers, Count, Verdicts

WORTH = Count(what="answers", low=0, high=1, count=10, said=0.9, true=0.8)
HASHES = ("system_hash", "fmu_sha256", "uncertain_sha256", "candidates_sha256")
BY = Verdicts(
    **dict.fromkeys(HASHES, "-"),
    system="room",
    version="0",
    made="2026-01-01",
    hours=168.0,
    noise="sensor",
    seed=1,
    strata={"none": 40, "listed": 60},
    nothing={"one": 3.0, "gap": -2.0, "best": -1.0},
    none={"one": -1.0, "left": 1.0, "rejected": 1.0},
    power=0.5,
    second=0.6,
    held={"all": 0.2},
    cover=0.9,
    doubt=2.0,
    reliability=[WORTH],
    answers=Answers(alarms=WORTH, named=WORTH, outside=WORTH),
)
