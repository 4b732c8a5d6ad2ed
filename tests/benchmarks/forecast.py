"""Figure 3 over many unseen systems: seven days of context with excitation, fourteen ahead without.

    python tests/benchmarks/forecast.py fmus/MixedAirCO2 --systems 50 [--run RUN]

Prints the median and the 90 % quantile of each output's RMSE, CVRMSE and NMBE, and the share of readings in the band.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from datagen.inputs import build_inputs
from datagen.sampling import sample_parameters
from datagen.simulator import Simulator
from datagen.tables import Piecewise
from diagnosis.forecasting.forecast import forecast
from diagnosis.recording import HOUR, Recording
from shared.errors import ZeroshotError
from shared.schema import build_shard
from shared.store import write_shard
from shared.system import System, load_system


def unseen(system: System, seed: int, index: int, noise: str, context: float, ahead: float, folder: Path) -> Recording:
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
    made = Simulator(system).run(names, inputs, start=start, stop=stop, record_from=begin)
    outputs = made.outputs + system.noise_sd(noise)[:, None] * rng.standard_normal(made.outputs.shape)
    shard = build_shard(
        system, indices=np.array([index]), root_seed=seed, parameters=theta[None], outputs=outputs[None],
        inputs=made.inputs[None], attributes={}, starts=np.array([begin]),
    ).isel(system=0)  # fmt: skip
    shard = shard.drop_vars("start").assign_coords(time=("time", made.time, shard["time"].attrs))
    path = folder / f"system-{index}.nc"
    write_shard(path, shard, [index])
    return replace(read_recording(path, system), outputs=outputs)


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("system", type=Path)
    parser.add_argument("--systems", type=int, default=5)
    parser.add_argument("--seed", type=int, default=9100, help="root seed; take one that no estimator was trained on")
    parser.add_argument("--run", type=Path)
    parser.add_argument("--noise", default="sensor")
    parser.add_argument("--occupancy", choices=["measured", "unknown"], default="measured")
    parser.add_argument("--context", type=float, default=168.0)
    parser.add_argument("--ahead", type=float, default=336.0)
    parser.add_argument("--starts", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("forecasts"))
    options = parser.parse_args()
    system = load_system(options.system)
    options.out.mkdir(parents=True, exist_ok=True)
    rows: dict[str, list[tuple[float, ...]]] = {name: [] for name in system.output_names}
    failed = 0
    for index in range(options.systems):
        began = time.perf_counter()
        try:
            record = unseen(system, options.seed, index, options.noise, options.context, options.ahead, options.out)
            done = forecast(
                system, record, context=options.context, ahead=options.ahead, run=options.run, noise=options.noise,
                occupancy=options.occupancy, starts=options.starts, draws=20,
            )  # fmt: skip
        except ZeroshotError as error:
            failed += 1
            print(f"system {index}: {error}", flush=True)
            continue
        for name, one in done.report.outputs.items():
            if one is not None:
                rows[name].append((one.rmse, one.cvrmse or np.nan, one.nmbe or np.nan, one.covered))
        said = ", ".join(f"{name} {values[-1][0]:.3g}" for name, values in rows.items() if values)
        print(f"system {index}: RMSE {said} ({time.perf_counter() - began:.0f} s)", flush=True)
    print(
        f"\n{options.systems} systems, {failed} failed\n\n"
        "| output | unit | RMSE median | RMSE 90 % | CVRMSE | NMBE | in band |"
    )
    print("|---|---|---|---|---|---|---|")
    for output in system.outputs:
        if rows[output.name]:
            values = np.array(rows[output.name])
            middle = np.nanmedian(np.abs(values), axis=0)
            print(
                f"| {output.name} | {output.unit} | {middle[0]:.3g} | {np.quantile(values[:, 0], 0.9):.3g} "
                f"| {middle[1]:.1%} | {middle[2]:.1%} | {values[:, 3].mean():.0%} |"
            )


if __name__ == "__main__":
    main()
