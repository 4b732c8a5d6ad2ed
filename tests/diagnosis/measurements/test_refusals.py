"""What cannot become a recording becomes a sentence and no file."""

import sys

import numpy as np
import pytest

from diagnosis.measurements import importer
from shared.errors import RecordingError
from tests.diagnosis.measurements.house_cases import MAPPING, measured
from tests.small_disk import SAID, small_disk


@pytest.mark.parametrize(
    ("change", "mapping", "said"),
    [
        (None, MAPPING.replace('"room"\nunit = "degC"', '"room"\nunit = "K"'), r"variables.warmth.*median 21.*degC"),
        (lambda d: d.assign(room=d["room"] + 273.15), MAPPING, "variables.warmth.*is it in K"),
        (lambda d: d.assign(room=21.0), MAPPING, r"variables.warmth: column 'room': every reading is 294.15 K"),
        (lambda d: d.iloc[:100], MAPPING, "spans 16.5 h; expected at least a day"),
        (
            lambda d: d.assign(other=d["room"] + 5.0).rename(columns={"other": "room"}),
            MAPPING,
            "variables.warmth: .* has several columns 'room'; expected a name for each",
        ),
        (lambda d: d.assign(room="warm"), MAPPING, "holds text such as 'warm'"),
        (lambda d: d.assign(room=np.nan), MAPPING, "column 'room' of .* is empty"),
        (
            lambda d: d.assign(outside=d["outside"].where(d.index % 60 < 30)),
            MAPPING,
            r"no inputs are missing \(outdoors in .*fill_up_to = \d+ under \[weather.temp_air\]",
        ),
        (None, MAPPING.replace("Europe/Amsterdam", "Mars/Olympus"), "time.zone: is 'Mars/Olympus'"),
        (
            None,
            MAPPING.replace("scale = 2.4", 'scale = "2.4"'),
            "variables.air.scale: is '2.4'; expected a number, with",
        ),
        (None, MAPPING.replace("fill = 0.0", "fill = true"), "variables.air.fill: is True; expected"),
        (
            None,
            MAPPING.replace('"kilowatts"', '"room"'),
            "variables.warmth: column 'room' is that of variables.gas, too",
        ),
        (
            None,
            MAPPING.replace('"outside"', '"room"'),
            "variables.warmth: column 'room' is that of weather.temp_air, too",
        ),
        (
            lambda d: d.assign(kilowatts=np.where(d["kilowatts"] > 1.9, "ON", "Off")),
            MAPPING,
            r"gas: column 'kilowatts' of .* holds text such as 'O.*; expected numbers \(scale = what ON stands for",
        ),
        (None, MAPPING.replace("Europe/Amsterdam", "germany"), "did you mean Europe/Berlin or Europe/Busingen"),
        (None, MAPPING.replace("variables.gas", "variables.gaz"), "'gaz' is neither output nor input of House"),
        (
            None,
            MAPPING.replace("weather.ghi", "weather.sunny"),
            "weather.sunny: is not known; expected one of temp_air",
        ),
        (None, MAPPING.replace("persons = 2.0\n", ""), "unit is presence but persons is missing"),
        (None, MAPPING.replace("[place]\nlatitude = 52.0\nlongitude = 5.0", ""), "place is missing"),
        (None, MAPPING.replace("schema_version = 1", ""), "schema_version: missing"),
        (
            None,
            MAPPING.replace('"kW"\n', '"kW"\nfill = "interpolate"\n'),
            "variables.gas: fill is 'interpolate', which only an input has; expected none",
        ),
        (None, MAPPING.replace("fill = 0.0", "fill_up_to = 6.0"), "variables: air: fill_up_to is 6 without fill"),
        (
            None,
            MAPPING.replace("fill = 0.0", "fill = -5.0"),
            r"variables.air: fill: is -5 m3/h, which is -0.00\d+ kg/s; expected .*, or valid = \[-5, highest\] b",
        ),
        (None, MAPPING + "\nlatitude = 36,1", r"not valid TOML: .*: 'latitude = 36,1'; write 36\.1, with a point"),
        (None, MAPPING.replace('system = "house.toml"', ""), "system is missing"),
        (
            None,
            MAPPING.replace('"Europe/Amsterdam"', '"Europe/Amsterdam"\nformat = "unix"'),
            "not a time of format 'unix'",
        ),
    ],
)
def test_each_fault_is_a_sentence_and_no_file(house, tmp_path, change, mapping, said):
    frame, _ = measured(days=3)
    with pytest.raises(RecordingError, match=said) as caught:
        house(frame if change is None else change(frame), mapping)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_written_to(house, tmp_path):
    (tmp_path / "out").write_text("a file, not a folder")
    with pytest.raises(RecordingError, match="nothing can be written there"):
        house(measured(days=2)[0])
    with pytest.raises(RecordingError, match=r"ending is '.csv'; expected .nc"):
        house(measured(days=2)[0], out="house.csv")


@pytest.mark.skipif(sys.platform == "win32", reason="no limit of a file's size there")
def test_a_full_disk(house, tmp_path, monkeypatch):
    write = importer.write_recording

    def onto_a_small_disk(*given):
        with small_disk():
            write(*given)

    monkeypatch.setattr(importer, "write_recording", onto_a_small_disk)
    with pytest.raises(RecordingError, match=rf"house\.nc: cannot be written \({SAID}\)"):
        house(measured(days=3)[0])
    assert list((tmp_path / "out").iterdir()) == []


def test_all_mistakes_of_a_mapping_are_said_at_once(house, tmp_path):
    wrong = (
        MAPPING.replace("zone =", "zoen =").replace("latitude = 52.0", "latitude = 520").replace("scale =", "skale =")
    )
    wrong = wrong.replace('unit = "kW"', "unit = 3").replace("fill = 0.0", 'fill = "all"')
    with pytest.raises(RecordingError) as caught:
        house(measured(days=2)[0], wrong + "[file]\ndecimal = ';'\n")
    first, *said = str(caught.value).split("\n  ")
    assert first.endswith("mapping.toml: has 6 mistakes:") and len(said) == 6
    for part in (
        "time.zoen: unknown field (found 'Europe/Amsterdam'); expected fields column, zone",
        "place.latitude: is 520; expected a number up to 90",
        "variables.gas.unit: is 3; expected text in quotation marks",
        "variables.air.skale: unknown field",
        "variables.air.fill: is 'all'; expected 'none', 'interpolate' or a number",
        "file.decimal: is ';'; expected '.' or ','",
    ):
        assert any(one.startswith(part) for one in said), part
    wrong = MAPPING.replace("variables.gas", "variables.gaz").replace('"degF" }', '"ppm" }').replace('"W/m2"', '"W"')
    sentence = r"(?s)3 mistakes:.*compare: unit 'ppm'.*'gaz' is neither.*weather.ghi: unit"
    with pytest.raises(RecordingError, match=sentence):
        house(measured(days=2)[0], wrong)
