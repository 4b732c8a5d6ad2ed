"""A small house whose limits are looked at."""

import pytest

from shared.system import parse_system
from tests.house import ROOM_AND_PERSONS

HOUSE = """
schema_version = 1
name = "House"
fmu = "{fmu}"
[experiment]
hours = 48.0
warm_up_hours = 240.0
[estimator]
channels = ["room"]
[[parameters]]
name = "ro"
unit = "K/kW"
min = 4.0
max = 12.0
[[parameters]]
name = "ri"
unit = "K/kW"
min = 0.2
max = 1.0
[[inputs]]
name = "To"
unit = "degC"
source = "constant"
value = 5.0
{readers}
"""


@pytest.fixture
def house_text(small_fmu):
    """``house_text("N", "P")``: of a house whose inputs of these names, in this order, are the persons in it."""
    fmu = small_fmu("house", attributes='canHandleVariableCommunicationStepSize="true"')
    units = {"N": "1", "P": "kW", "S": "kW/m2"}

    def make(*readers):
        tables = [(name, 'source = "occupancy"') for name in readers]
        tables += [(name, 'source = "constant"\nvalue = 0.0') for name in units if name not in readers]
        text = "\n".join(f'[[inputs]]\nname = "{name}"\nunit = "{units[name]}"\n{source}' for name, source in tables)
        return HOUSE.format(fmu=fmu.as_posix(), readers=text) + ROOM_AND_PERSONS

    return make


@pytest.fixture
def house(house_text, tmp_path):
    """``house("N", "P")``: that house."""
    return lambda *readers: parse_system(house_text(*readers), tmp_path / "house.toml")
