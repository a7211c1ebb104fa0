"""Fixed-interval smoothing: the state at each sample given all samples of the record.

The modified Bryson-Frazier form (Bierman 1977, chapter X) runs backwards with the adjoint of the filter. It inverts no
covariance, so the process noise may be zero. Without process noise the smoothed states are one trajectory of the model,
which starts at the initial state with the best fit to the record.
"""

from collections.abc import Iterator
from itertools import pairwise

import casadi as ca
import numpy as np

from fifthwheel.base.native import Scan, compiled
from fifthwheel.base.types import Array
from fifthwheel.estimate.filters import kalman
from fifthwheel.estimate.filters.model import Model, pack, packed_size, partitioned, sizes, unpack
from fifthwheel.estimate.filters.step_rows import SampleRows

CHUNK = 500
"""Number of rows in one pass, which bounds the memory. The forward pass stores only the carry before each chunk; the
backward pass repeats the filter chunk by chunk."""


@compiled(Scan)
def smoother_step(model: Model, report: Model | None = None) -> ca.Function:
    """The compiled backward step of the smoother.

    carry = [adjoint state, adjoint covariance, dt, d] of the following row;
    sample = [dt, d, y, weight, accepted, x-, P-]; constant = that of the filter; output = smoothed [x, P].

    With `report`, a model of the same state without free parameters: constant = [that of the filter, c of the report];
    output = [outputs of the report at the smoothed state, their variances].
    """
    n_x, n_d, n_p, n_c, n_y = sizes(model)
    n_P, n_report = packed_size(n_x), 0 if report is None else sizes(report)[3]
    carry, adjoint, information, dt_next, d_next = partitioned("carry", n_x, n_P, 1, n_d)
    sample, dt, d, y, _, accepted, before, P_before = partitioned("sample", 1, n_d, n_y, n_y, n_y, n_x, n_P)
    constant, p, c, _, r, _, c_report = partitioned("constant", n_p, n_c, n_P, n_y, 1, n_report)
    information, P_before = unpack(information, n_x), unpack(P_before, n_x)

    predicted, H = kalman.observe(model, before, d, p, c)
    open_gate = ca.SX(1e300)  # the filter has already gated the samples
    x, P, channels, gains = kalman.correct(before, P_before, predicted, H, y, accepted, r, open_gate)
    _, _, slopes = kalman.predict(model, x, P, dt_next, d_next, p, c, ca.SX(n_x, n_x))
    F = slopes[:, :n_x]
    adjoint, information = F.T @ adjoint, ca.mtimes([F.T, information, F])
    smoothed, P_smoothed = x - P @ adjoint, P - ca.mtimes([P, information, P])
    results = smoothed, pack(P_smoothed)
    if report is not None:
        results = kalman.report_outputs(report, smoothed, P_smoothed, ca.SX(n_x, 0), d, c_report)
    for channel, (gain, row) in reversed(list(zip(channels, gains, strict=True))):
        used = channel.accepted
        correction = ca.SX.eye(n_x) - gain @ row
        adjoint = correction.T @ adjoint - used * row.T * channel.innovation / channel.variance
        information = ca.mtimes([correction.T, information, correction]) + used * row.T @ row / channel.variance
    carried = ca.vertcat(adjoint, pack(information), dt, d)
    outputs = [ca.densify(carried), ca.densify(ca.vertcat(*results))]
    return ca.Function("smoother", [carry, sample, constant], outputs, {"cse": True})


def smoothed_chunks(
    model: Model, report: Model | None, rows: Array | SampleRows, carry: Array, constant: Array
) -> Iterator[tuple[slice, Array]]:
    """Outputs of `smoother_step` given all N rows, for B carries and constants of the filter, (B, M, n_output).

    They come in chunks of M rows, of which the last is the first. The constants have those of the report after those of
    the filter.
    """
    n_x, n_d, _, _, n_y = sizes(model)
    forwards, backwards = kalman.kalman_step(model), smoother_step(model, report)
    filter_constant, constant = constant[:, : forwards.n_constant], constant[:, : backwards.n_constant]
    slices = [slice(*edges) for edges in pairwise([*range(0, len(rows), CHUNK), len(rows)])]
    starts = [carry]
    for chunk in slices[:-1]:
        starts.append(forwards.batch(starts[-1], rows[chunk], filter_constant)[0])
    back = np.zeros((len(carry), backwards.n_carry))
    back[:, backwards.n_carry - n_d :] = rows[-1:][0, 1 : 1 + n_d]
    for chunk, start in zip(reversed(slices), reversed(starts), strict=True):
        _, out = forwards.batch(start, rows[chunk], filter_constant)
        samples = np.broadcast_to(rows[chunk], (len(carry), *rows[chunk].shape))
        accepted_and_predicted = out[:, :, -(n_y + n_x + packed_size(n_x)) :]
        samples = np.concatenate([samples, accepted_and_predicted], axis=2)
        back, smoothed = backwards.batch(back, samples[:, ::-1], constant)
        yield chunk, smoothed[:, ::-1]
