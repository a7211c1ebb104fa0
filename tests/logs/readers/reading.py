"""All samples of a log that is read in pieces."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fifthwheel.logs.source import LogSource


def read(log: LogSource, *names: str) -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Time and values of some columns, or of all."""
    parts: dict[str, list[tuple[Any, Any]]] = {}
    for piece in log.pieces(names or tuple(log.columns)):
        assert 0 < piece.done <= 1
        assert piece.time is not None
        for name, values in piece.values.items():
            assert log.columns[name].clock == piece.clock
            assert values.dtype == np.float64
            parts.setdefault(name, []).append((piece.time, values))
    return {name: (np.concatenate([t for t, _ in p]), np.concatenate([v for _, v in p])) for name, p in parts.items()}
