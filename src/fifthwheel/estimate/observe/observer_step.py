"""The compiled step of an observer: a Kalman filter with reported outputs and a monitor of its consistency.

Its model is the chain with the bank of the road and the offsets of sensors. The offsets are states. The bank is a state
if measurements are to correct it, otherwise a parameter.

A bank that is not estimated is considered (Schmidt 1966): measurements do not correct it, and its effect on all states
is part of every variance. s is the change of the states by one standard deviation sigma of the bank b, with the gain K:

    s- = F s + dx-/db sigma        s = s- - K (H s- + dh/db sigma)

Every reported variance is multiplied by the excess of the NIS (`monitor.excess`), as the Birge ratio scales the
uncertainty of a least-squares fit: innovations that are larger than the filter predicts show an error of the vehicle or
of a sensor, which the state has too.

A change of the parameters along a direction changes the filter's state by x', its sensitivity. The gain K of the filter
stays as it is: its change acts on innovations only, which are small. It would change the rms of a sigma by a few
percent, and needs ten times the operations. It is the difference of two filters with the same gains, which
`step_with_gains` computes.
"""

import functools
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Generic, NamedTuple

import casadi as ca
import numpy as np

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.lazy import lazy
from fifthwheel.base.native import Scan, compiled
from fifthwheel.base.types import Array
from fifthwheel.data.channels import (
    ARTICULATION,
    LOAD_TRANSFER,
    PREDICTED_LOAD_TRANSFER,
    ROLL,
    ROLL_RATE,
    SIDESLIP,
    YAW_RATE,
)
from fifthwheel.estimate.filters import kalman
from fifthwheel.estimate.filters.kalman import ChannelUpdate
from fifthwheel.estimate.filters.model import pack, packed_size, partitioned, sizes, split, unpack
from fifthwheel.estimate.observe import monitor
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics import ChainModel
from fifthwheel.model.dynamics.steering import own_states
from fifthwheel.model.dynamics.symbolic import Matrix, transition_matrix
from fifthwheel.model.dynamics.tyres import Tyres
from fifthwheel.model.dynamics.unit_equations import BANK
from fifthwheel.truck import Vehicle


class ObservedChain:
    """A `estimate.filters.model.Model` without parameters p, built by `observed_chain`.

    The states of the chain come first; the offsets, whose names begin with those of the steer angles, are the last
    states. The bank, the last state of the chain, is either estimated, or the last parameter of c.
    """

    def __init__(self, chain: ChainModel, offsets: tuple[str, ...], estimates_bank: bool) -> None:
        self.chain, self.offsets, self.estimates_bank = chain, offsets, estimates_bank
        self.roll, self.inputs, self.outputs = chain.roll, chain.inputs, chain.outputs
        self.unknowns = (BANK, *offsets)
        self.states = (*(chain.states if estimates_bank else chain.states[:-1]), *offsets)
        self.known = chain.known if estimates_bank else (*chain.known, BANK)  # names of c
        self.sizes = len(self.states), 2 * len(self.inputs), 0, len(self.known), len(self.outputs)
        self.identity = "observed chain", chain.identity, offsets, estimates_bank

    @lazy
    def transition(self) -> ca.Function:
        """(x, dt, d, p, c) -> x+, the state dt seconds later."""
        own, of_chain, n = self._symbols
        return ca.Function("transition", own, [ca.vertcat(self.chain.transition(*of_chain)[:n], own[0][n:])])

    @lazy
    def transition_parts(self) -> ca.Function:
        """(x, dt, d, p, c) -> M, of which exp(M) is the derivative of [x+, bank] by [x, bank] if the bank is a
        parameter, else that of x+ by x."""
        (own, of_chain, n), m = self._symbols, len(self.offsets)
        M, steered = self.chain.exponent(*of_chain), self.chain.steer_offset_exponent(*of_chain)
        n_chain = M.shape[0]
        by_offset = ca.horzcat(steered, ca.SX(n_chain, m - steered.shape[1]))
        M = ca.blockcat([[M, by_offset], [ca.SX(m, n_chain), ca.SX(m, m)]])
        order = [*range(n), *range(n_chain, n_chain + m), *range(n, n_chain)]
        return ca.Function("transition_parts", own, [M[order, order]])

    def transition_matrix(self, exponent: Matrix) -> Matrix:
        """dx+/dx (n, n) from the result of `transition_parts`, and the column of a bank that is a parameter."""
        return transition_matrix(exponent)[: len(self.states), :]

    @lazy
    def observation(self) -> ca.Function:
        """(x, d, p, c) -> y"""
        own, of_chain, _ = self._instant
        return ca.Function("observation", own, [ca.densify(self.chain.observation(*of_chain))])

    @lazy
    def observation_jacobian(self) -> ca.Function:
        """(x, d, p, c) -> dy/dx, and the column of a bank that is a parameter."""
        own, of_chain, n = self._instant
        by_offset = ca.SX(len(self.outputs), len(self.offsets))
        by_offset[:, self._free] = self.chain.observation_sensitivity(*of_chain)
        H = self.chain.observation_jacobian(*of_chain)
        return ca.Function("observation_jacobian", own, [ca.horzcat(H[:, :n], by_offset, H[:, n:])])

    @property
    def _free(self) -> list[int]:
        """Places of the offsets that are parameters of the chain."""
        return [self.offsets.index(name) for name in self.chain.free]

    @lazy
    def _symbols(self) -> tuple[list[ca.SX], list[ca.SX], int]:
        """[x, dt, d, p, c], the same arguments of the chain, and the number of its states in x."""
        n_x, n_d, _, n_c, _ = self.sizes
        names = (("x", n_x), ("dt", 1), ("d", n_d), ("p", 0), ("c", n_c))
        x, dt, d, p, c = (ca.SX.sym(name, size) for name, size in names)
        n, n_known = n_x - len(self.offsets), len(self.chain.known)
        return [x, dt, d, p, c], [ca.vertcat(x[:n], c[n_known:]), dt, d, x[n:][self._free], c[:n_known]], n

    @property
    def _instant(self) -> tuple[list[ca.SX], list[ca.SX], int]:
        """`_symbols` without dt."""
        (x, _, *own), (state, _, *of_chain), n = self._symbols
        return [x, *own], [state, *of_chain], n

    def known_values(self, values: Mapping[str, float]) -> Array:
        """c from values by name, SI."""
        return np.array([values[name] for name in self.known], dtype=np.float64)


def observed_chain(
    vehicle: Vehicle,
    outputs: Sequence[str],
    *,
    offset_states: Sequence[str] = (),
    roll: bool,
    estimate_bank: bool,
    tyres: Tyres = "linear",
) -> ObservedChain:
    """The model of a vehicle, see `model.dynamics.model`; vehicles of equal topology share one model.

    The offsets of the signals `offset_states` are states, whether or not these are among the outputs. The derivative of
    the speed is an input.
    """
    offsets = tuple(f"{name}.offset" for name in (*vehicle.steer_signals(), *offset_states))
    known = dynamics.all_parameters(vehicle, outputs)
    free = tuple(name for name in offsets if name in known)
    chain = dynamics.model(vehicle, outputs, roll=roll, bank=True, free=free, tyres=tyres, braking=True)
    return _observed_chain(chain, offsets, estimate_bank)


_observed_chain = functools.cache(ObservedChain)


def reported_signals(vehicle: Vehicle, *, roll: bool, bank: bool = False) -> tuple[str, ...]:
    """Signals that an observer reports: with roll also roll angles, roll rates and, if the static axle loads are
    determined, the load transfer ratio of each axle group, present and predicted; own states of the steering; the bank
    of the road if estimated."""
    units = [unit.name for unit in vehicle.units]
    names = [f"{channel.quantity}.{u}" for channel in (SIDESLIP, YAW_RATE) for u in units]
    names += [f"{ARTICULATION.quantity}.{u}" for u in units[1:]]
    if roll:
        names += [f"{channel.quantity}.{u}" for channel in (ROLL, ROLL_RATE) for u in units]
        with suppress(VehicleError):  # the static loads are not determined
            groups, ratios = vehicle.axle_loads(), (LOAD_TRANSFER, PREDICTED_LOAD_TRANSFER)
            names += [f"{channel.quantity}.{path}" for channel in ratios for path in groups]
    names += own_states(vehicle)
    return (*names, BANK) if bank else tuple(names)


class ObserverLayout(NamedTuple):
    """Numbers of elements of the parts of carry, sample and constant of `observer_step`."""

    carry: tuple[int, ...]  # x, P, s
    sample: tuple[int, ...]  # dt, d, y, weight
    constant: tuple[int, ...]  # c, Q, R, gate^2, c of the report, sigma of a considered bank

    @classmethod
    def of(cls, model: ObservedChain, report: ObservedChain) -> "ObserverLayout":
        """The layout of an observer."""
        n_x, n_d, _, n_c, n_y = sizes(model)
        n_P, considered = packed_size(n_x), not model.estimates_bank
        return cls(
            carry=(n_x, n_P, n_x * considered),
            sample=(1, n_d, n_y, n_y),
            constant=(n_c, n_P, n_y, 1, len(report.known), int(considered)),
        )


class FilterStep(NamedTuple, Generic[Matrix]):
    """One step of the filter."""

    after: Matrix  # state (n,)
    covariance: Matrix  # P (n, n)
    considered: Matrix  # s (n, 1); (n, 0) without a considered bank
    channels: list[ChannelUpdate[Matrix]]
    carry: Matrix  # of the next step, as in `ObserverLayout`
    gains: Sequence[Matrix] = ()  # of each channel of an extended Kalman filter, (n, 1)


FilterFunction = Callable[[ObservedChain, ObserverLayout, Matrix, Matrix, Matrix], FilterStep[Matrix]]
"""(model, layout, carry, sample, constant) -> one step of a filter."""


def filter_step(
    model: ObservedChain, layout: ObserverLayout, carry: Matrix, sample: Matrix, constant: Matrix
) -> FilterStep[Matrix]:
    """Prediction and update of the (extended) Kalman filter; carry, sample and constant as in `ObserverLayout`.

    Each channel is linearised at the state that the channels before it have corrected. After a start with a wide
    covariance, an accelerometer on saturating tyres then is linearised at the state that the gyros give.
    """
    x, P, s = split(carry, layout.carry)
    dt, d, y, weight = split(sample, layout.sample)
    c, q, r, limit, _, sigma = split(constant, layout.constant)
    n, no_p = x.shape[0], type(x)(0, 1)
    x, P, slopes = kalman.predict(model, x, unpack(P, n), dt, d, no_p, c, unpack(q, n))
    s, channels, gains = slopes @ _effects(s, n, sigma), [], []
    for i in range(y.shape[0]):
        predicted, slope = kalman.observe(model, x, d, no_p, c, slice(i, i + 1))
        row, effect = slope[:, :n], slope[:, n:] @ ca.diag(sigma)
        x, P, s, channel, gain = kalman.correct_channel(x, P, y[i] - predicted, row, weight[i], r[i], limit, s, effect)
        channels.append(channel)
        gains.append(gain)
    return FilterStep(x, P, s, channels, ca.vertcat(x, pack(P), ca.vec(s)), gains)


def _effects(s: Matrix, n: int, sigma: Matrix) -> Matrix:
    """Change (n + 1, 1) of state and bank by one standard deviation of a considered bank; (n, 0) without one."""
    return ca.vertcat(ca.reshape(s, n, sigma.shape[0]), ca.diag(sigma))


class TrackedLayout(NamedTuple):
    """Numbers of elements of what an output has for sensitivities."""

    after: int  # state after the step
    gains: int  # of the channels, 0 for one that is missing or not accepted
    of_bank: int  # variances of the reported signals that a considered bank causes

    @classmethod
    def of(cls, model: ObservedChain, report: ObservedChain) -> "TrackedLayout":
        """The layout for an observer."""
        n, _, _, _, m = sizes(model)
        return cls(n, n * m, len(report.outputs))


@compiled(functools.partial(Scan, matrices=True))
def observer_step(model: ObservedChain, report: ObservedChain) -> ca.Function:
    """The compiled step of an observer, with the parts of `TrackedLayout` before the output of `observer_function`."""
    return observer_function(model, report, filter_step, ca.MX, tracked=True)


def output_size(model: ObservedChain, report: ObservedChain) -> int:
    """Number of elements of an output of `observer_function` that is not tracked."""
    return 2 * len(report.outputs) + 3 * len(model.outputs) + 3


def observer_function(
    model: ObservedChain,
    report: ObservedChain,
    filter_step: FilterFunction[Matrix],
    kind: type[Matrix],
    *,
    tracked: bool = False,
) -> ca.Function:
    """A filter of `model` with the outputs of `report`, their variances, and the monitor, with matrices of a type.

    carry = [x, P, s, monitor]; sample = [dt, d, y, weight]; constant = [c, Q, R, gate^2, c of the report, sigma of a
    considered bank, settings of the monitor]; output = [reported, their sigmas, innovation, variance, accepted,
    settling, NIS, restart].
    """
    layout = ObserverLayout.of(model, report)
    carry, filtered, monitored = partitioned("carry", sum(layout.carry), len(monitor.START), kind=kind)
    sample, dt, d, _, weight = partitioned("sample", *layout.sample, kind=kind)
    constant, numbers, monitor_settings = partitioned("constant", sum(layout.constant), 2, kind=kind)
    _, _, _, limit, c_report, sigma = split(numbers, layout.constant)
    step: FilterStep[Matrix] = filter_step(model, layout, filtered, sample, numbers)
    effects = _effects(step.considered, len(model.states), sigma)
    reported, own, of_bank = kalman.report_outputs(report, step.after, step.covariance, effects, d, c_report)
    channels = kalman.channel_columns(step.channels)
    arguments = [monitored, channels, weight, dt, d, limit, monitor_settings, reported, own + of_bank]
    monitored, sigmas, findings = _findings(model, len(report.outputs)).call(arguments)
    before = [step.after, *step.gains, of_bank] if tracked else []
    carried, output = ca.vertcat(step.carry, monitored), ca.vertcat(*before, reported, sigmas, channels, findings)
    return ca.Function("observer", [carry, sample, constant], [carried, ca.densify(output)], {"cse": True})


def _findings(model: ObservedChain, n_report: int) -> ca.Function:
    """(carry of the monitor, `channel_columns`, weight, dt, d, gate^2, settings, reported signals, their variances) ->
    (carry of the monitor, sigmas of the reported signals, [settling, NIS, restart])."""
    k, m = len(model.inputs), len(model.outputs)
    arguments = [ca.SX.sym("a", size) for size in (len(monitor.START), 3 * m, m, 1, 2 * k, 1, 2, n_report, n_report)]
    carry, columns, weight, dt, d, limit, settings, reported, variances = arguments
    channels = [ChannelUpdate(*ca.vertsplit(columns[i::m])) for i in range(m)]
    sudden = monitor.sudden_change(model.inputs, d[:k], d[k:], dt)
    carry, findings = monitor.monitor(carry, channels, weight, dt, sudden, limit, settings)
    settling, nis, disagrees = ca.vertsplit(findings)
    restart = ca.fmax(disagrees, monitor.diverged(reported, variances, dt))
    raised = monitor.excess(nis) * variances
    sigmas = ca.sqrt(ca.if_else(raised < 0, 0, raised))  # not a number remains so
    return ca.Function("findings", arguments, [carry, sigmas, ca.vertcat(settling, nis, restart)], {"cse": True})


@compiled(functools.partial(Scan, lanes=8, optimised=True))
def step_with_gains(model: ObservedChain) -> ca.Function:
    """The compiled step of the filter with given gains. No carry; sample = [dt, d, y, gains, x]; constant = c; output =
    x after the step."""
    n, n_d, _, n_c, m = sizes(model)
    sample, dt, d, y, gains, x = partitioned("sample", 1, n_d, m, m * n, n)
    nothing, no_p, c = ca.SX.sym("nothing", 0), ca.SX(0, 1), ca.SX.sym("c", n_c)
    x = model.transition(x, dt, d, no_p, c)
    for i, gain in enumerate(ca.vertsplit(gains, n) if m else ()):
        x = x + gain * (y[i] - model.observation(x, d, no_p, c)[i])
    return ca.Function("with_gains", [nothing, sample, c], [ca.SX(0, 1), ca.densify(x)], {"cse": True})


@compiled(functools.partial(Scan, lanes=8, optimised=True))
def report_step(model: ObservedChain, report: ObservedChain) -> ca.Function:
    """The compiled step that gives the reported signals. No carry; sample = [d, x]; constant = c of the report."""
    n, n_d, n_c = len(model.states), sizes(model)[1], len(report.known)
    sample, d, x = partitioned("sample", n_d, n)
    nothing, c = ca.SX.sym("nothing", 0), ca.SX.sym("c", n_c)
    reported = ca.densify(report.observation(x, d, ca.SX(0, 1), c))
    return ca.Function("report", [nothing, sample, c], [ca.SX(0, 1), reported], {"cse": True})
