"""Samples of the parameters behind recordings, as a file."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import xarray as xr

from shared.errors import EstimatorError
from shared.netcdf import write_netcdf
from shared.store import temporary_name


def write_samples(
    path: Path,
    samples: np.ndarray,
    systems: list[int | None],
    parameters: list[str],
    units: list[str],
    attributes: dict[str, str | int],
) -> None:
    """Write samples (windows, n, parameters) [own units] as NetCDF: one variable per parameter, with its unit.

    They are over (system, sample), or over (sample) alone where the recording has no systems. Raises EstimatorError if
    the file cannot be written.
    """
    alone = systems == [None]
    dims = ("sample",) if alone else ("system", "sample")
    variables = {
        name: (dims, samples[0, :, k] if alone else samples[:, :, k], {"units": unit})
        for k, (name, unit) in enumerate(zip(parameters, units, strict=True))
    }
    coordinates = {} if alone else {"system": systems}
    # a seed may be any whole number, a number in NetCDF has 64 bits
    facts = {name: one if isinstance(one, str) or one < 1 << 63 else str(one) for name, one in attributes.items()}
    temporary = temporary_name(path)
    try:
        write_netcdf(xr.Dataset(variables, coordinates, facts), temporary, {})
        os.replace(temporary, path)
    except OSError as error:
        raise EstimatorError(f"{path}: cannot be written ({error.strerror}); expected a place to write to") from None
    finally:
        temporary.unlink(missing_ok=True)
