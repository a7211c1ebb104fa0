"""States of a record with their sigmas and status."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fifthwheel._atomic import atomic_write
from fifthwheel._types import Array


class Status(IntEnum):
    """Status of a sample; its states are NaN if it is TOO_SLOW or INPUT_MISSING."""

    OK = 0
    COASTING = 1
    """No accepted measurement for longer than `ObserverSettings.coast`: the model predicts from its inputs."""
    TOO_SLOW = 2
    """Below the lowest speed of the model."""
    INPUT_MISSING = 3
    """The speed or a steer angle is missing or implausible for longer than `ObserverSettings.hold`."""
    INCONSISTENT = 4
    """The measurements contradict the vehicle, the speed or the steer angles: `States.nis` is above
    `ObserverSettings.max_nis`. The states may be wrong by many sigmas."""


@dataclass(frozen=True, kw_only=True)
class States:
    """States of a record of N samples."""

    name: str
    time: Array  # (N,) s
    values: Mapping[str, Array]  # by signal, (N,) each, SI
    sigma: Mapping[str, Array]  # standard deviation, (N,) each
    status: NDArray[np.int8]  # (N,) `Status`
    nis: Array  # (N,) health: normalised innovation squared, averaged over channels and time; 1 is expected
    innovation: Mapping[str, Array]  # by measured signal, measurement less prediction, (N,), NaN where missing
    innovation_sigma: Mapping[str, Array]  # standard deviation, (N,) each
    accepted: Mapping[str, NDArray[np.bool_]]  # (N,) each, False where missing or outside the gate


def write_states(states: Sequence[States], path: Path) -> None:
    """Write states to a Parquet file: log, time, states in SI, their sigmas as "<state>.sigma", status and nis.

    Raises:
        OSError: the file cannot be written.
    """
    import pyarrow as pa
    from pyarrow import parquet

    tables = []
    for record in states:
        sigma = {f"{name}.sigma": values for name, values in record.sigma.items()}
        columns: dict[str, NDArray[Any]] = {
            "time": record.time,
            **record.values,
            **sigma,
            "status": record.status,
            "nis": record.nis,
        }
        arrays = {name: _arrow(values) for name, values in columns.items()}
        name = record.name.encode()
        offsets = pa.py_buffer(np.array([0, len(name)], dtype=np.int32))
        names = pa.StringArray.from_buffers(1, offsets, pa.py_buffer(name))
        arrays["log"] = pa.DictionaryArray.from_arrays(_arrow(np.zeros(len(record.time), dtype=np.int32)), names)
        tables.append(pa.table(arrays))
    with atomic_write(path) as temporary:
        parquet.write_table(pa.concat_tables(tables, promote_options="permissive").unify_dictionaries(), temporary)


def _arrow(values: NDArray[Any]) -> Any:
    """Values (N,) as an array of Arrow. The conversion of objects of Python would import pandas."""
    import pyarrow as pa

    buffer = pa.py_buffer(np.ascontiguousarray(values))
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), [None, buffer])
