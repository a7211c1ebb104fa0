"""What an observer says of a record: states, their sigmas, and whether they may be believed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fifthwheel.whole import whole

Array = NDArray[np.float64]


class Status(IntEnum):
    """Whether a sample's states may be believed; where not OK or COASTING they are NaN."""

    OK = 0
    COASTING = 1  # no measurement for a while: the model runs on its inputs alone
    TOO_SLOW = 2  # under the speed that the model holds for
    INPUT_MISSING = 3  # no speed or steer angle for longer than it may be held


@dataclass(frozen=True, kw_only=True)
class States:
    """States of one record; N samples."""

    name: str
    time: Array  # (N,) s
    values: Mapping[str, Array]  # by signal, (N,) each, SI
    sigma: Mapping[str, Array]  # standard deviation, (N,) each
    status: NDArray[np.int8]  # (N,) of Status
    innovation: Mapping[str, Array]  # by measured signal, value less prediction, (N,), NaN where missing
    innovation_sigma: Mapping[str, Array]
    accepted: Mapping[str, NDArray[np.bool_]]  # False where missing or outside the gate


def save(states: Sequence[States], path: Path) -> None:
    """Write one Parquet file: log, time, the states in SI, their sigmas as "<state>.sigma", and the status."""
    import pyarrow as pa
    from pyarrow import parquet

    tables = []
    for one in states:
        columns = {"time": one.time, **one.values, **{f"{name}.sigma": sigma for name, sigma in one.sigma.items()}}
        log = pa.array([one.name] * len(one.time)).dictionary_encode()
        tables.append(pa.table({**columns, "status": one.status, "log": log}))
    with whole(path) as part:
        parquet.write_table(pa.concat_tables(tables, promote_options="permissive").unify_dictionaries(), part)
