"""Filter and smoother over one stretch for several trucks at a time, told as an observer tells it.

Both take what is used from the rows' weights: nothing is gated, so the constant's gate must let everything through.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fifthwheel.dynamics import ChainModel
from fifthwheel.filters import kalman, smoother
from fifthwheel.filters.model import packed_size, sizes
from fifthwheel.observe.step import step

Array = NDArray[np.float64]

CHUNK = 500
"""Rows that are run through at a time. The smoother keeps the filter's predictions of no more: on the way forwards it
keeps where each part begins, and the filter runs through a part once more when the way back has come to it."""


def parts_of(rows: Array) -> list[slice]:
    """Consecutive parts of the rows."""
    return [slice(*edges) for edges in pairwise([*range(0, len(rows), CHUNK), len(rows)])]


def filtered(model: ChainModel, report: ChainModel, rows: Array, carry: Array, constant: Array) -> Array:
    """What `report` shows and the variances of that, given the rows so far: (B, M, 2 n).

    Args:
        rows: (M, 1 + n_d + 2 n_y), for a compiled step.
        carry: [x, P] of each truck before the first row, (B, n).
        constant: [c, Q, R, gate^2, c of the report] of each truck, (B, n).
    """
    scan = step(model, report)
    told = np.empty((len(carry), len(rows), 2 * len(report.outputs)))
    for part in parts_of(rows):
        carry, out = scan.batch(carry, rows[part], constant)
        told[:, part] = out[:, :, : told.shape[2]]
    return told


def smoothed(model: ChainModel, report: ChainModel, rows: Array, carry: Array, constant: Array) -> Array:
    """What `report` shows and the variances of that, given all rows: (B, M, 2 n); arguments as for `filtered`."""
    n_x, n_d, _, _, n_y = sizes(model)
    n_P = packed_size(n_x)
    forwards, backwards = kalman.step(model), smoother.step(model, report)
    of_filter = constant[:, : forwards.n_constant]
    parts, starts = parts_of(rows), [carry]
    for part in parts[:-1]:
        starts.append(forwards.batch(starts[-1], rows[part], of_filter)[0])
    back = np.zeros((len(carry), backwards.n_carry))
    back[:, -n_d:] = rows[-1, 1 : 1 + n_d]
    told = np.empty((len(carry), len(rows), backwards.n_output))
    for part, start in zip(reversed(parts), reversed(starts), strict=True):
        _, out = forwards.batch(start, rows[part], of_filter)
        shared = np.hstack([rows[part], rows[part, -n_y:]])  # all that has a weight is accepted
        own = np.broadcast_to(shared, (len(carry), *shared.shape)), out[:, :, -(n_x + n_P) :]
        back, found = backwards.batch(back, np.concatenate(own, axis=2)[:, ::-1], constant)
        told[:, part] = found[:, ::-1]
    return told
