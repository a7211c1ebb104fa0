"""How long a step of the model may be, and where a record needs steps between its samples."""

import functools
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from fifthwheel.dynamics.analysis import matrices
from fifthwheel.dynamics.chain import lagging_groups
from fifthwheel.errors import SignalError
from fifthwheel.vehicle import Vehicle

Array = NDArray[np.float64]

REACH = {(False, False): 0.11, (False, True): 0.76, (True, False): 0.45, (True, True): 0.88}
"""Largest product of step and fastest eigenvalue, that with its margin of 1.25, by (with roll, side forces with a lag):
a step then errs by less than 1e-6 of the largest state. Series differ in length, see `model.ORDER`; the yaw model's
matrix is farther from normal than its eigenvalues tell, and so is that of side forces with a lag. 1e-6 is reached near
0.121, 0.78, 0.469 and 0.90: the catalogue's trucks and two trains of three units, 3 to 35 m/s, relaxation lengths of
0.1 to 0.8 m on all groups or on some, 400 random states and steer angles each."""

_MOST = 1e5
"""Steps between two samples."""
SPEEDS = np.geomspace(1.0, 60.0, 32)
"""Where the fastest mode is reckoned, m/s; between them it is interpolated."""


class StepLimit:
    """The longest step of a vehicle's model at each speed; in `short` one that is surely allowed, for each whole m/s.

    Args:
        margin: how much faster than this vehicle's the fastest mode may become while parameters are being estimated.
    """

    def __init__(self, vehicle: Vehicle, *, roll: bool, margin: float = 1.25) -> None:
        fastest = [np.abs(np.linalg.eigvals(matrices(vehicle, u, roll=roll).A)).max() for u in SPEEDS]
        self.longest = REACH[roll, bool(lagging_groups(vehicle))] / (margin * np.array(fastest))
        # a little less than the least within each whole m/s: what is shorter needs no dividing, and no array to say so
        grid = np.arange(0.0, SPEEDS[-1] + 2, 1 / 16)
        limit = self(np.maximum(grid, 1 / 16)) * 0.99
        least = np.minimum.reduceat(np.minimum(limit[:-1], limit[1:]), np.arange(0, len(grid) - 1, 16))
        self.short: list[float] = least.tolist()

    def __call__(self, speed: Array) -> Array:
        """Seconds (N,) at speeds (N,), m/s."""
        crawling = np.minimum(np.asarray(speed) / SPEEDS[0], 1.0)  # below the table eigenvalues go with 1/u
        racing = np.minimum(SPEEDS[-1] / np.asarray(speed), 1.0)  # and above it with u, where side forces have a lag
        return np.asarray(np.interp(speed, SPEEDS, self.longest) * crawling * racing, dtype=np.float64)


@functools.lru_cache(64)
def _limit(vehicle: Vehicle, roll: bool) -> StepLimit:
    return StepLimit(vehicle, roll=roll)


def longest(vehicle: Vehicle, speed: Array, *, roll: bool) -> Array:
    """`StepLimit` at once: seconds (N,) at speeds (N,), m/s."""
    return _limit(vehicle, roll)(speed)


def pieces(gap: Array, limit: Array) -> NDArray[np.int64]:
    """How many steps each gap between samples needs.

    Args:
        gap: (N - 1,) s.
        limit: (N,) longest step at each sample, s.

    Raises:
        SignalError: so many that no truck can be meant.
    """
    needed = np.ceil(gap / np.minimum(limit[1:], limit[:-1]))
    if not (needed < _MOST).all():
        at = int((~(needed < _MOST)).argmax())
        raise SignalError(
            f"speed: samples {at + 1} and {at + 2} need {needed[at]:.1g} steps between them; no truck is as fast, "
            "or as slow, as one of them, or the time between them is none that was driven"
        )
    return np.maximum(needed, 1).astype(np.int64)


def subdivide(time: Array, inputs: Array, limit: Array) -> tuple[Array, Array, NDArray[np.int64]]:
    """Time and inputs with enough steps between the samples, linear in between.

    Every step is reckoned from its own two samples alone, so that a record taken sample by sample gives the same bits.

    Args:
        time: (N,) increasing, s.
        inputs: (N, k).
        limit: (N,) longest step at each sample, s.

    Returns:
        Times (M,), inputs (M, k), and the places of the N samples among them (N,).
    """
    count = pieces(np.diff(time), limit)
    if (count == 1).all():
        return time, inputs, np.arange(len(time))
    places = np.concatenate([[0], np.cumsum(count)])
    first = np.repeat(np.arange(len(count)), count)
    part = (np.arange(1, places[-1] + 1) - places[first]) / count[first]
    fine = np.concatenate([time[:1], time[first] + (time[first + 1] - time[first]) * part])
    between = inputs[first] + (inputs[first + 1] - inputs[first]) * part[:, None]
    between = np.concatenate([inputs[:1], between])
    fine[places], between[places] = time, inputs
    return fine, between, places


def step_inputs(time: Array, inputs: Array) -> tuple[Array, Array]:
    """dt (M,) and d (M, 2 k) for `ChainModel`: the inputs at each step's begin and end.

    The first row has no step before it: its dt is 0 and its begin is its end.
    """
    before = np.vstack([inputs[:1], inputs[:-1]])
    return np.diff(time, prepend=time[0]), np.hstack([before, inputs])


def stacked(inputs: Mapping[str, Array], names: tuple[str, ...]) -> Array:
    """Inputs by name as columns (N, k) in the model's order."""
    return np.column_stack([np.asarray(inputs[name], dtype=np.float64) for name in names])
