"""All samples of a log that is read in chunks."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fifthwheel.data.logs.source import LogSource


def read(log: LogSource, *names: str) -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Time and values of some columns, or of all."""
    parts: dict[str, list[tuple[Any, Any]]] = {}
    for chunk in log.chunks(names or tuple(log.columns)):
        assert 0 < chunk.done <= 1
        assert chunk.time is not None
        for name, values in chunk.values.items():
            assert log.columns[name].clock == chunk.clock
            assert values.dtype == np.float64
            parts.setdefault(name, []).append((chunk.time, values))
    return {name: (np.concatenate([t for t, _ in p]), np.concatenate([v for _, v in p])) for name, p in parts.items()}
