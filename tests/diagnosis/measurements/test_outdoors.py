"""What a mapping says of the weather is used, or said not to be."""

import numpy as np
import pytest
import xarray as xr

from tests.diagnosis.measurements.house_cases import HOUSE, MAPPING, measured

GHI = '[weather.ghi]\ncolumn = "sun"\nunit = "W/m2"\n'
AIR = '[weather.temp_air]\ncolumn = "outside"\nunit = "degC"\n'
PARTS = '[weather.dni]\ncolumn = "beam"\nunit = "W/m2"\n[weather.dhi]\ncolumn = "diffuse"\nunit = "W/m2"\n'


def constant(name, value, unit):
    return f'[weather.{name}]\nconstant = {value}\nunit = "{unit}"\n'


def with_parts():
    frame, hours = measured()
    up = frame["sun"] > 0
    return frame.assign(beam=np.where(up, 200.0 + np.sin(hours), 0.0), diffuse=0.4 * frame["sun"])


def unused(report):
    return {one.split("weather.")[1].split(" ")[0]: one for one in report.notes if one.startswith("could not use")}


def sky_of(air, dew, cover):
    """Clark and Allen with Walton's clouds, or Swinbank's air, as EnergyPlus' and Swinbank's papers write them [K]."""
    n = 10 * cover
    clear = 0.787 + 0.764 * np.log(dew / 273) if dew is not None else (0.0552 * air**1.5 / air) ** 4
    return air * (clear * (1 + 0.0224 * n - 0.0035 * n**2 + 0.00028 * n**3)) ** 0.25


@pytest.mark.parametrize(("dew", "cover"), [(275.15, 0.9), (None, 0.5)])
def test_constants_of_dew_point_and_clouds_make_the_sky(house, dew, cover):
    mapping = MAPPING + constant("opaque_cover", cover, "fraction")
    mapping += constant("temp_dew", dew - 273.15, "degC") if dew else ""
    report = house(measured()[0], mapping)
    data = xr.load_dataset(report.recording)
    np.testing.assert_allclose(data["sky"], sky_of(data["outdoors"], dew, cover), atol=0.3 if dew else 0.7)
    assert any("opaque_cover as the mapping's constant" in one and one.startswith("sky") for one in report.notes)
    assert not unused(report)


def test_relative_humidity_makes_the_sky_as_its_dew_point_does(house):
    """Humidity by Buck's equation (1981), another one than is used to make it a dew point again."""

    def pressure(degrees):
        return 6.1121 * np.exp((18.678 - degrees / 234.5) * degrees / (257.14 + degrees))

    frame = measured()[0]
    frame["humid"] = 100.0 * pressure(2.0) / pressure(frame["outside"])
    cover = constant("opaque_cover", 0.5, "fraction")
    wet = house(frame, MAPPING + cover + '[weather.relative_humidity]\ncolumn = "humid"\nunit = "percent"\n')
    sky = xr.load_dataset(wet.recording)["sky"]
    assert any("dew point of the relative humidity (Magnus)" in one for one in wet.notes) and not unused(wet)
    dew = house(frame, MAPPING + cover + constant("temp_dew", 2.0, "degC"), out="dew.nc")
    np.testing.assert_allclose(sky, xr.load_dataset(dew.recording)["sky"], atol=0.02)


def test_measured_parts_of_the_sun_are_used(house):
    frame = with_parts()
    erbs = house(frame, out="erbs.nc")
    both = house(frame, MAPPING + PARTS, out="both.nc")
    closed = house(frame, MAPPING.replace(GHI, "") + PARTS, out="closed.nc")
    assert "split by Erbs, carried" in " ".join(erbs.notes)
    assert "split by measured dni and dhi, carried" in " ".join(both.notes)
    assert "computed from beam and diffuse: split by measured dni and dhi" in " ".join(closed.notes)
    sunshine = [float(xr.load_dataset(one.recording)["sunshine"].mean()) for one in (erbs, both, closed)]
    assert abs(sunshine[1] / sunshine[0] - 1) > 0.1
    assert sunshine[2] == pytest.approx(sunshine[1], rel=0.1)
    assert any("irradiance together are" in one for one in both.notes)  # they do not make up the global one
    assert not unused(both) and not unused(closed)


@pytest.mark.parametrize(
    ("mapping", "said"),
    [(
            MAPPING.replace(GHI, constant("ghi", 100.0, "W/m2")),
            {"ghi": r"weather.ghi (a constant): sunshine is computed from what the sun did"},
        ), (
            MAPPING.replace(GHI, PARTS.split("[weather.dhi]")[0]),
            {"dni": "weather.dni (column beam): sunshine takes ghi, or both dni and dhi"},
        ), (
            MAPPING.replace("[weather.temp_air]", "[variables.outdoors]") + constant("temp_dew", 5.0, "degC"),
            {"temp_dew": "sky is computed from temp_air, which is not mapped"},
        ), (
            MAPPING.replace(AIR, AIR + 'compare = { column = "room 2", unit = "degF" }\n'),
            {"temp_air.compare": "(column room 2): weather is compared under variables only"},
        ),],
)  # fmt: skip
def test_what_could_not_be_used_is_said(house, mapping, said):
    found = unused(house(with_parts(), mapping))
    assert found.keys() == said.keys()
    assert all(words in found[name] for name, words in said.items())


def steps_of(report, name):
    (found,) = [one for one in report.variables if one.name == name]
    return found.stuck, found.missing


@pytest.mark.parametrize(
    ("hours", "value", "more", "stuck"),
    [
        (40, 0.0, "", False),  # a calm
        (40, 1.3, "", True),
        (130, 0.0, "", True),  # frozen
        (40, 0.0, "stuck_after = 24.0\n", True),
    ],
)
def test_wind_may_be_zero_for_days_and_nothing_else(house, tmp_path, hours, value, more, stuck):
    """A cup anemometer does not turn in a calm night."""
    wind = '{ name = "breeze", unit = "m/s", source = "weather", column = "wind_speed" },\n  { name = "people"'
    (tmp_path / "windy.toml").write_text(HOUSE.replace('{ name = "people"', wind))
    frame, at = measured(days=7)
    frame["cups"] = np.where((at > 10) & (at <= 10 + hours), value, 2.0 + np.sin(at))
    mapping = f'{MAPPING}[weather.wind_speed]\ncolumn = "cups"\nunit = "km/h"\nfill = 7.2\n{more}'
    report = house(frame, mapping, system=tmp_path / "windy.toml")
    assert (steps_of(report, "breeze")[0] > 0) == stuck
    if not stuck:
        assert xr.load_dataset(report.recording)["breeze"].values.min() == 0.0
