"""Unscented Kalman filters as the step of an observer, for comparison; see filters.py.

Julier and Uhlmann (1997), with 2 n points at sqrt(n) standard deviations and equal weights (kappa = 0), which is the
cubature rule of Arasaratnam and Haykin (2009). No weight is negative. Each step works on a square root S of the
covariance P = S S' (Van der Merwe and Wan 2001): it triangularises and shrinks square roots, and never subtracts
covariances, so that P is positive semidefinite whatever the rounding, also if P is singular.

Noise is additive. Points are drawn again after the prediction, and measurements correct the state channel by channel,
as in `fifthwheel.estimate.filters.kalman`. A considered bank is a further column of the joint square root, which
measurements do not weigh.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Literal, NamedTuple

import casadi as ca
import numpy as np

from fifthwheel.base.lazy import lazy
from fifthwheel.base.native import Scan
from fifthwheel.base.types import Array
from fifthwheel.estimate.filters.kalman import ChannelUpdate, gate
from fifthwheel.estimate.filters.model import pack, pack_array, packed_size, split, unpack, unpack_array
from fifthwheel.estimate.observe.observer_model import ObserverModel
from fifthwheel.estimate.observe.observer_step import (
    FilterFunction,
    FilterStep,
    ObservedChain,
    ObserverLayout,
    observer_function,
)
from fifthwheel.model.dynamics.unit_equations import BANK


class Deviations(NamedTuple):
    """Mean (m,) of a function of the state, and deviations from it, whose products with their transpose add up to the
    covariance."""

    mean: ca.SX
    odd: ca.SX  # (m, n), of the columns of S
    even: ca.SX  # (m, n), zero where the function is linear


def unscented(function: Callable[[ca.SX], ca.SX], x: ca.SX, root: ca.SX) -> Deviations:
    """The unscented transform of a function of the state with the mean x (n,) and the covariance root root' (n, n)."""
    n = x.shape[0]
    scale = n**0.5
    ahead, behind = (ca.horzcat(*[function(x + sign * scale * root[:, i]) for i in range(n)]) for sign in (1, -1))
    mean = (ca.sum2(ahead) + ca.sum2(behind)) / (2 * n)
    return Deviations(mean, (ahead - behind) / (2 * scale), ((ahead + behind) / 2 - ca.repmat(mean, 1, n)) / scale)


def lower_triangular(wide: ca.SX) -> ca.SX:
    """The lower triangular L (n, n) with L L' = W W' of W (n, k), by the modified Gram-Schmidt method.

    A row that depends on those above it has a zero on the diagonal.
    """
    n = wide.shape[0]
    rows, lower = [wide[i, :] for i in range(n)], ca.SX(n, n)
    for i in range(n):
        lower[i, i] = length = ca.sqrt(ca.sumsqr(rows[i]))
        unit = rows[i] / ca.if_else(length > 0, length, 1)
        for j in range(i + 1, n):
            lower[j, i] = rows[j] @ unit.T
            rows[j] = rows[j] - lower[j, i] * unit
    return lower


def cholesky(covariance: ca.SX) -> ca.SX:
    """The lower triangular L (n, n) with L L' = P; a pivot below its rounding error is zero, with its column."""
    n = covariance.shape[0]
    lower = ca.SX(n, n)
    for j in range(n):
        pivot = covariance[j, j] - ca.sumsqr(lower[j, :j])
        positive = pivot > n * np.finfo(float).eps * covariance[j, j]
        lower[j, j] = root = ca.sqrt(ca.if_else(positive, pivot, 0))
        for i in range(j + 1, n):
            lower[i, j] = (covariance[i, j] - ca.dot(lower[i, :j], lower[j, :j])) / ca.if_else(positive, root, 1)
            lower[i, j] *= positive
    return lower


def correct(
    joint: Deviations, considered: ca.SX, x: ca.SX, root: ca.SX, y: ca.SX, weight: ca.SX, r: ca.SX, limit: ca.SX
) -> tuple[ca.SX, ca.SX, ca.SX, list[ChannelUpdate[ca.SX]]]:
    """Measurement update of a joint square root of state and measurements (n + m, 2 n), channel by channel (Potter).

    With a row l of the joint square root L, the gain is L l' / s with s = l l' + r, and L then is
    L - gain l / (1 + sqrt(r / s)).

    Args:
        joint: of the measurements (m,).
        considered: change (n + m, k) of state and measurements by one standard deviation of each considered parameter.
        x, root: state (n,) and S (n, n) before the update.
        y, weight, r: measurements, their weights and variances, (m,) each.
        limit: squared gate.

    Returns:
        State, square root (n, 2 n), `considered` (n, k) after the update, and the updates of the channels.
    """
    n, m = x.shape[0], y.shape[0]
    mean = ca.vertcat(x, joint.mean)
    square_root = ca.vertcat(ca.horzcat(root, ca.SX(n, n)), ca.horzcat(joint.odd, joint.even))
    channels = []
    for i in range(m):
        row, effect = square_root[n + i, :], considered[n + i, :]
        innovation, exact = y[i] - mean[n + i], ca.sumsqr(row) + r[i]
        variance = exact + ca.sumsqr(effect)
        accepted = gate(innovation, variance, weight[i], limit)
        gain = accepted * (square_root @ row.T) / exact
        mean, considered = mean + gain * innovation, considered - gain @ effect
        square_root = square_root - gain @ row / (1 + ca.sqrt(r[i] / exact))
        channels.append(ChannelUpdate(weight[i] * innovation, variance, accepted))
    return mean[:n], square_root[:n, :], considered[:n, :], channels


Form = Literal["covariance", "square root"]


def unscented_step(form: Form) -> FilterFunction[ca.SX]:
    """`observer_step.filter_step` of the filter that carries P or S."""

    def filter_step(
        model: ObservedChain, layout: ObserverLayout, carry: ca.SX, sample: ca.SX, constant: ca.SX
    ) -> FilterStep[ca.SX]:
        x, packed, s = split(carry, layout.carry)
        dt, d, y, weight = split(sample, layout.sample)
        c, q, r, limit, _, sigma = split(constant, layout.constant)
        n, m, no_p = x.shape[0], y.shape[0], ca.SX(0, 1)
        root = ca.tril(unpack(packed, n)) if form == "square root" else cholesky(unpack(packed, n))
        s = ca.reshape(s, n, s.shape[0] // n)

        def moved(sign: float) -> ca.SX:  # c with the bank moved by one standard deviation
            changed = ca.SX(c)
            changed[model.known.index(BANK)] += sign * sigma
            return changed

        later = unscented(lambda state: model.transition(state, dt, d, no_p, c), x, root)
        noise = cholesky(unpack(q, n)) * ca.sqrt(dt)
        before, root = later.mean, lower_triangular(ca.horzcat(later.odd, later.even, noise))
        considered = ca.SX(n + m, s.shape[1])
        joint = unscented(lambda state: model.observation(state, d, no_p, c), before, root)
        if not model.estimates_bank:
            ends = [model.transition(x + sign * s, dt, d, no_p, moved(sign)) for sign in (1, -1)]
            s = (ends[0] - ends[1]) / 2
            outputs = [model.observation(before + sign * s, d, no_p, moved(sign)) for sign in (1, -1)]
            considered = ca.vertcat(s, (outputs[0] - outputs[1]) / 2)
        after, wide, s, channels = correct(joint, considered, before, root, y, weight, r, limit)
        root = lower_triangular(wide)
        covariance = root @ root.T
        stored = pack(root) if form == "square root" else pack(covariance)
        return FilterStep(after, covariance, s, channels, ca.vertcat(after, stored, ca.vec(s)))

    return filter_step


@cache
def _scan(model: ObservedChain, report: ObservedChain, form: Form) -> Scan:
    return Scan(observer_function(model, report, unscented_step(form), ca.SX))


@dataclass(frozen=True, kw_only=True, eq=False)
class UnscentedModel(ObserverModel):
    """The numbers of an observer with an unscented filter."""

    form: Form

    @lazy
    def scan(self) -> Scan:
        """The compiled step."""
        return _scan(self.model, self.report, self.form)

    def start(self, inputs: Mapping[str, float], *, suspect: bool = False) -> Array:
        """[x, P or S, considered] before a first sample; arguments as in `ObserverModel`."""
        start, n = super().start(inputs, suspect=suspect), len(self.model.states)
        if self.form == "square root":
            packed = slice(n, n + packed_size(n))
            values, axes = np.linalg.eigh(unpack_array(start[packed], n))
            lower = np.linalg.qr((axes * np.sqrt(np.maximum(values, 0.0))).T, mode="r").T
            start[packed] = pack_array(lower)
        return start
