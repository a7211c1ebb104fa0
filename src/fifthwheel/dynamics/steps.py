"""How long a step of the model may be, and where a record needs steps between its samples."""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from fifthwheel.dynamics.analysis import matrices
from fifthwheel.dynamics.model import ORDER
from fifthwheel.vehicle import Vehicle

Array = NDArray[np.float64]
TOLERANCE = 1e-6
"""Largest error of a step's transition matrix, as the first term of the Taylor series that the step leaves out."""


def longest(vehicle: Vehicle, speed: Array, *, roll: bool, margin: float = 1.25) -> Array:
    """The longest step that keeps to the tolerance at each speed, s.

    Args:
        speed: (N,) m/s, positive.
        margin: how much faster than this vehicle's the fastest mode may become while parameters are being estimated.
    """
    order = ORDER[roll] + 1
    reach = (TOLERANCE * math.factorial(order)) ** (1 / order)
    low, high = float(np.min(speed)), float(np.max(speed))
    grid = np.geomspace(low, max(high, low * 1.001), 12)
    fastest = [np.abs(np.linalg.eigvals(matrices(vehicle, u, roll=roll).A)).max() for u in grid]
    return reach / (margin * np.interp(speed, grid, fastest))


def subdivide(time: Array, limit: Array) -> tuple[Array, NDArray[np.int64]]:
    """A time base that holds every sample and enough steps between.

    Args:
        time: (N,) increasing, s.
        limit: (N,) longest step up to each sample, s.

    Returns:
        The times (M,), and the places of the N samples among them (N,).
    """
    gaps = np.diff(time)
    pieces = np.maximum(np.ceil(gaps / np.minimum(limit[1:], limit[:-1])), 1).astype(np.int64)
    places = np.concatenate([[0], np.cumsum(pieces)])
    fine = np.interp(np.arange(places[-1] + 1), places, time)
    fine[places] = time
    return fine, places


def input_rows(time: Array, inputs: Mapping[str, Array], fine: Array) -> tuple[Array, Array]:
    """dt (M,) and d (M, 2 k) for `ChainModel`: the k inputs at the step's begin and at its end, linear between samples.

    The first row has no step before it: its dt is 0 and its begin is its end.
    """
    columns = np.column_stack([np.interp(fine, time, values) for values in inputs.values()])
    before = np.vstack([columns[:1], columns[:-1]])
    return np.diff(fine, prepend=fine[0]), np.hstack([before, columns])
