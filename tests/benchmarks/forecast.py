"""Figure 3 over many unseen systems: seven days of context with excitation, fourteen ahead without.

    python tests/benchmarks/forecast.py fmus/MixedAirCO2 --systems 50 [--run MixedAirCO2]

Ahead, the weather and the persons of the recording drive the model. Prints the median and quantiles over systems of
each output's RMSE against its noisy readings (the sensor's own noise, which nobody can forecast, is beside it), CVRMSE
and NMBE (medians of absolute values; a temperature has none), and the shares of readings within the 90 % band, below
and above it. In brackets: 90 % intervals, bootstrapped over systems.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from resumed import depends, resumed

from datagen.driving.inputs import build_inputs
from datagen.driving.sampling import sample_parameters
from datagen.driving.tables import Piecewise
from datagen.simulating.constants import constants, sample_factors, values_of
from datagen.simulating.recording import on_the_clock
from datagen.simulating.simulator import Simulator
from diagnosis.forecasting.forecast import forecast
from diagnosis.recording import HOUR, Recording
from shared.errors import ZeroshotError
from shared.schema import build_shard
from shared.store import write_shard
from shared.system import System, load_system


def unseen(
    system: System, seed: int, index: int, noise: str, context: float, ahead: float, folder: Path, drawn: bool = False
) -> Recording:
    """A recording of a system whose excitation ends with the context, with sensor noise; also as a file."""
    from diagnosis.recording import read_recording

    system = system.with_experiment(hours=context + ahead, start=(0.0, 8760.0 - context - ahead))
    rng = np.random.default_rng([seed, index])
    begin = 24 * HOUR * int(rng.integers((8760 - context - ahead) // 24))
    start, stop = begin - system.experiment.warm_up_hours * HOUR, begin + (context + ahead) * HOUR
    switched_off = {}
    for one in system.inputs:
        if one.source == "excitation":
            plain = build_inputs(system, root_seed=seed, index=index, start=start, stop=stop)
            k = list(plain.names).index(one.name)
            times = np.arange(start, begin + context * HOUR + 1, HOUR)
            values = plain.at(times)[:, k]
            values[-1] = 0.0
            switched_off[one.name] = Piecewise(times, values)
    inputs = build_inputs(system, root_seed=seed, index=index, start=start, stop=stop, overrides=switched_off)
    theta = sample_parameters(system, seed, index)
    names = dict(zip(system.parameter_names, theta.tolist(), strict=True))
    simulator = Simulator(system)
    walls = values_of(constants(system, simulator.fmu), sample_factors(system, seed, index)) if drawn else {}
    made = simulator.run(names | walls, inputs, start=start, stop=stop, record_from=begin)
    outputs = made.outputs + system.noise_sd(noise)[:, None] * rng.standard_normal(made.outputs.shape)
    shard = build_shard(
        system, indices=np.array([index]), root_seed=seed, parameters=theta[None], outputs=outputs[None],
        inputs=made.inputs[None], attributes={}, starts=np.array([begin]),
    )  # fmt: skip
    path = folder / f"system-{index}.nc"
    write_shard(path, on_the_clock(shard.isel(system=0)), [index])
    return replace(read_recording(path, system), outputs=outputs)


def beyond(done: Any, name: str) -> tuple[float, float]:
    """Shares of an output's readings ahead that lie below the band, and above it."""
    k = done.system.output_names.index(name)
    ahead = slice(done.context, None)
    read = done.measured[k, ahead]
    kept = np.isfinite(read)
    return (
        float((read < done.low[k, ahead])[kept].mean()),
        float((read > done.high[k, ahead])[kept].mean()),
    )


def made(case: dict[str, Any]) -> dict[str, Any]:
    """One forecast: scores by output, or why there is none."""
    began = time.process_time()
    system, folder = load_system(case["system"]), Path(case["folder"])
    context, ahead = case["context"], case["ahead"]
    try:
        record = unseen(system, case["seed"], case["index"], case["noise"], context, ahead, folder, case["drawn"])
        done = forecast(
            system, record, context=context, ahead=ahead, run=case["run"], noise=case["noise"],
            occupancy=case["occupancy"], starts=case["starts"], draws=case["draws"],
        )  # fmt: skip
    except ZeroshotError as error:
        return {"error": str(error)}
    finally:
        (folder / f"system-{case['index']}.nc").unlink(missing_ok=True)
    scores = {
        name: [one.rmse, one.cvrmse, one.nmbe, one.covered, *beyond(done, name)]
        for name, one in done.report.outputs.items()
        if one is not None
    }
    return {"scores": scores, "seconds": time.process_time() - began}


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("system", type=Path)
    parser.add_argument("--systems", type=int, default=50)
    parser.add_argument("--seed", type=int, default=9100, help="root seed; take one that no estimator was trained on")
    parser.add_argument("--run", type=Path)
    parser.add_argument("--noise", default="sensor")
    parser.add_argument("--occupancy", choices=["measured", "unknown"], default="measured")
    parser.add_argument("--context", type=float, default=168.0)
    parser.add_argument("--ahead", type=float, default=336.0)
    parser.add_argument("--starts", type=int, default=2)
    parser.add_argument("--draws", type=int, default=20)
    parser.add_argument("--targets", nargs="*", default=[], help="of the RMSE, such as TRoo=0.3; counts the rooms")
    parser.add_argument("--drawn", action="store_true", help="systems with uncertain constants drawn")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("forecasts"))
    options = parser.parse_args()
    system = load_system(options.system)
    options.out.mkdir(parents=True, exist_ok=True)
    names = ("seed", "noise", "occupancy", "context", "ahead", "starts", "draws", "drawn")
    common = {name: getattr(options, name) for name in names}
    common |= {"system": str(options.system), "folder": str(options.out)}
    common["run"] = str(options.run) if options.run else None
    cases = [{**common, "index": index} for index in range(options.systems)]
    of = depends(options.system, run=options.run)
    rows = resumed(options.out / "cases.jsonl", cases, made, of=of, workers=options.workers)
    good = [one for one in rows if "error" not in one]
    for one in rows:
        if "error" in one:
            print(one["error"])
    print(
        f"\n{len(rows)} systems, {len(rows) - len(good)} failed, root seed {options.seed}, persons {options.occupancy}"
    )
    print(f"{np.median([one['seconds'] for one in good]):.0f} s of the processor each\n")
    print("| output | unit | RMSE median | of the sensor alone | RMSE 10 %, 90 % | CVRMSE | NMBE", end=" ")
    print("| in the 90 % band | below, above |")
    print("|---|---|---|---|---|---|---|---|---|")
    targets = {name: float(value) for name, value in (one.split("=") for one in options.targets)}
    kept = []
    for output, alone in zip(system.outputs, system.noise_sd(options.noise), strict=True):
        values = np.array([one["scores"][output.name] for one in good if output.name in one["scores"]], dtype=float)
        if len(values):
            middle, (low, high) = np.median(values[:, 0]), np.quantile(values[:, 0], [0.1, 0.9])
            seen = [np.abs(column[np.isfinite(column)]) for column in values[:, 1:3].T]
            cvrmse, nmbe = (f"{np.median(some):.1%}" if len(some) else "-" for some in seen)
            rows = np.random.default_rng(0).integers(len(values), size=(1000, len(values)))
            first, last = np.quantile(np.median(values[rows, 0], axis=1), [0.05, 0.95])
            some, most = np.quantile(values[rows, 3].mean(axis=1), [0.05, 0.95])
            print(
                f"| {output.name} | {output.unit} | {middle:.3g} [{first:.3g}, {last:.3g}] | {alone:.3g} "
                f"| {low:.3g}, {high:.3g} | {cvrmse} | {nmbe} "
                f"| {values[:, 3].mean():.1%} [{some:.1%}, {most:.1%}] "
                f"| {values[:, 4].mean():.1%}, {values[:, 5].mean():.1%} |"
            )
            if output.name in targets:
                target = targets[output.name]
                reached = np.sum(values[:, 0] <= target)
                kept.append(f"{output.name}: {reached} of {len(values)} at most {target:g} {output.unit}")
    print("\n".join(kept))


if __name__ == "__main__":
    main()
