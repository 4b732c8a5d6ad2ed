"""Steps by regime and by month, told by hand."""

import numpy as np

from datagen.comparing.regimes import regimes
from datagen.driving.tables import InputTable


def test_regimes_follow_from_the_description(default_system):
    """Of five one-hour steps in which some inputs have these means."""
    columns = {"nPer": [0, 2, 2, 0, 0], "HFac": [0, 0, 400, 60, 40], "excHea": [100, -100, 0, 100, 0]}
    names, edges = tuple(default_system.input_names), 3600.0 * np.arange(6)
    values = np.stack([columns.get(name, [0] * 5) for name in names], axis=1).astype(float)
    table = InputTable(names, edges, values, values.copy(), np.zeros(6, dtype=bool))
    outputs = np.zeros((4, 5))
    # at rest, at 5 kW, saturated, saturated, at rest: with the excitation on top
    outputs[default_system.output_names.index("QHea")] = [100, 4900, 10000, 10100, 0]
    found = regimes(default_system, table, edges, outputs)
    assert found["nPer: occupied"].tolist() == [False, True, True, False, False]
    assert found["HFac: sun"].tolist() == [False, False, True, True, False]
    assert found["QHea: at its lowest"].tolist() == [True, False, False, False, True]
    assert found["QHea: in between"].tolist() == [False, True, False, False, False]
    assert found["QHea: at its highest"].tolist() == [False, False, True, True, False]
    assert found["mOA: at its lowest"].all()  # it never moves
