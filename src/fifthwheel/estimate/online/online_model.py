"""Setup and model of a learner: the yaw-roll model with the unknowns as parameters, and discrepancies of channels."""

import functools
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from fifthwheel.base.errors import SignalError
from fifthwheel.base.types import Array
from fifthwheel.data.channels import LEARNED, YAW_RATE, is_of, measured_signals
from fifthwheel.estimate.filters.step_rows import SMALLEST_PLAY
from fifthwheel.estimate.identify.given import applied
from fifthwheel.estimate.identify.settings import OneStage
from fifthwheel.estimate.identify.setup import Setup, simplified, with_tyre_law
from fifthwheel.estimate.identify.statement import stated
from fifthwheel.estimate.identify.unknowns.parameters import VARIATION, known_of, left_out
from fifthwheel.estimate.identify.unknowns.unknown import Unknown
from fifthwheel.estimate.online.settings import LearnerSettings
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics import ChainModel
from fifthwheel.model.dynamics.sensors import wheel_pairs
from fifthwheel.model.dynamics.symbolic import Matrix, transition_matrix
from fifthwheel.model.dynamics.tyres import Tyres
from fifthwheel.truck import Vehicle

REFERENCE_SPEED = 20.0
"""Speed at which the understeer gradient is computed, m/s."""
NO_LIMIT = 1e6
"""More than any acceleration, m/s^2; a number that C has too."""
LINEAR_TYRES = 0.06
"""Default variation of the cornering stiffness of a linear tyre from drive to drive, as a fraction: slip, load and
longitudinal force change it, and differ in each drive."""


class PlayContacts:
    """The contacts of the plays of some steer angles, sample by sample; see `step_rows.play_contact`."""

    def __init__(self, count: int) -> None:
        self._contacts = [0.0] * count

    def update(
        self, gap: float, last: Sequence[float], inputs: Sequence[float], plays: Sequence[float]
    ) -> tuple[list[float], list[float]]:
        """Inputs of the extended model at both ends of a step of `gap` seconds.

        `last` and `inputs` are speed and steer angles there; `plays`, rad, is empty if they are exactly zero.
        """
        before = self._contacts
        after = list(before)
        for i, play in enumerate(plays):
            step = (inputs[1 + i] - last[1 + i]) / max(play, SMALLEST_PLAY)
            after[i] = min(0.5, max(-0.5, before[i] + step))
        self._contacts = after
        end = 1 + len(before)  # of the steer angles; then what is derived from the speed
        rates = [(b - a) / max(gap, 1e-3) for a, b in zip(last[1:end], inputs[1:end], strict=True)]
        before_step, after_step = ([*x[:end], *c, *rates, *x[end:]] for x, c in ((last, before), (inputs, after)))
        return before_step, after_step


class Excitation:
    """A causal measure of the steering excitation.

    States and measurements do not measure it: on a straight road they are noise, and noise looks like excitation.

    A steer angle d corresponds to the steady lateral acceleration u^2 d / (L + K u^2), with the wheelbase L of the
    first unit and the understeer gradient K of the vehicle. Its mean over `high_pass_time` is subtracted; the rest is
    squared and averaged over `excitation_window`. The steered axle with the largest result counts. Beyond
    `max_lateral_acceleration`, averaged over the same time, or `max_speed_rate` nothing is learned, except of tyres
    that saturate.
    Estimates do not change the excitation.
    """

    def __init__(self, vehicle: Vehicle, axles: int, settings: LearnerSettings, *, tyres: Tyres = "linear") -> None:
        self.settings, self.axles = settings, axles
        limits = settings.max_lateral_acceleration, settings.max_speed_rate
        self.largest, self.largest_rate = limits if tyres == "linear" else (NO_LIMIT, NO_LIMIT)
        self.wheelbase, self.understeer = vehicle.wheelbase, _understeer_gradient(vehicle)
        self.restart()

    def restart(self) -> None:
        """Discard all samples."""
        self.mean = [math.nan] * self.axles
        self.power = [0.0] * self.axles
        self.level = [0.0] * self.axles
        self.speed_rate = 0.0
        self.on = False

    def update(self, dt: float, inputs: Sequence[float]) -> bool:
        """Whether to learn from the speed, m/s, the steer angles, rad, and the derivative of the speed, m/s^2, of a
        sample dt seconds after the last one."""
        self.speed_rate = inputs[-1]
        settings, squared = self.settings, inputs[0] * inputs[0]
        gain = squared / (self.wheelbase + self.understeer * squared)
        slow, fast = dt / (settings.high_pass_time + dt), dt / (settings.excitation_window + dt)
        for i in range(self.axles):
            acceleration, mean = gain * inputs[1 + i], self.mean[i]
            if mean != mean:  # NaN at the first sample
                mean = acceleration
            self.mean[i] = mean = mean + slow * (acceleration - mean)
            self.power[i] += fast * ((acceleration - mean) ** 2 - self.power[i])
            self.level[i] += fast * (acceleration - self.level[i])
        limit = settings.stop_excitation if self.on else settings.start_excitation
        self.on = max(self.power) > limit * limit and not self.is_beyond_limit
        return self.on

    @property
    def is_beyond_limit(self) -> bool:
        """Whether the averaged acceleration of a steer angle, or the derivative of the speed, exceeds its limit."""
        return max(map(abs, self.level)) > self.largest or abs(self.speed_rate) > self.largest_rate


def _understeer_gradient(vehicle: Vehicle) -> float:
    """Understeer gradient K, rad s^2, by the steady yaw rate of the linear model; 0 for an oversteering vehicle."""
    speed = REFERENCE_SPEED
    m = dynamics.matrices(vehicle, speed, roll=False)
    yaw_rate = m.states.index(f"yaw_rate.{vehicle.units[0].name}")
    gain = -speed * float(np.linalg.solve(m.A, m.B[:, 0])[yaw_rate])
    return max(1 / gain - vehicle.wheelbase / speed**2, 0.0) if gain > 0 else 0.0


Structure = tuple[tuple[tuple[str, int], ...], tuple[tuple[str, int], ...], tuple[str, ...]]
"""`own`, `slopes` and `given` of an `OnlineModel`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class OnlineModel:
    """An `estimate.filters.model.Model` whose parameters p are the values of unknowns; built by `online_model`.

    The output of a channel is that of the chain plus its discrepancy, a first-order process (`noise_model`). The states
    are those of the chain, then the discrepancies. c = [known parameters of the chain, given values of the parameters
    that several unknowns change, their slopes, time constant of the discrepancies].
    """

    chain: ChainModel
    own: tuple[tuple[str, int], ...]  # parameter and index of each unknown that is the value of one parameter
    slopes: tuple[tuple[str, int], ...]  # parameter and index of the unknown of each slope
    given: tuple[str, ...]  # parameters that have no unknown of their own, but are changed by others
    discrepancies: int  # their number: that of the channels, or 0
    transition: ca.Function
    observation: ca.Function
    transition_parts: ca.Function
    rates: ca.Function
    rate_slopes: ca.Function
    observation_slopes: ca.Function
    identity: tuple[object, ...]  # of the model, for the cache of machine code

    def constant(self, values: Mapping[str, float], unknowns: Sequence[Unknown], time_constant: float) -> Array:
        """c from the values of all parameters of the chain, SI, and the time constant of the discrepancies, s."""
        slopes = [unknowns[i].slopes[name] for name, i in self.slopes]
        given = [values[name] for name in self.given]
        return np.concatenate([self.chain.known_values(values), given, slopes, [time_constant]])

    def transition_matrix(self, exponent: Matrix, decay: Matrix) -> Matrix:
        """dx+/dx (n, n) from the results of `transition_parts`."""
        return ca.diagcat(transition_matrix(exponent), decay * type(decay).eye(self.discrepancies))

    def values(self, p: ca.SX, c: ca.SX) -> dict[str, ca.SX]:
        """All parameters of the chain by name, from p and c."""
        return _values(self.chain, (self.own, self.slopes, self.given), p, c)


def online_setup(vehicle: Vehicle, signals: Collection[str], settings: OneStage) -> Setup:
    """The setup of a learner; arguments and errors are those of `Learner`. The estimated unknowns come first."""
    vehicle, settings = applied(vehicle, settings)
    settings = with_tyre_law(vehicle, settings)[0]
    if settings.tyre_law == "linear":
        names = [f"{path}.cornering_stiffness.{VARIATION}" for path in vehicle.group_paths()]
        more = [name for name in names if stated(settings.given, name, "1", 0.0).sigma is None]
        settings = replace(settings, given={**settings.given, **dict.fromkeys(more, f"+- {LINEAR_TYRES!r}")})
    if not settings.roll:
        raise SignalError("roll: expected True, because a learner models roll, got False; leave it out")
    if "speed" not in signals:
        raise SignalError("speed: not among the signals; the model needs the forward speed, add it in m/s")
    vehicle = simplified(vehicle, settings).with_logged_steering(signals, "the signals")
    units = [unit.name for unit in vehicle.units]
    outputs = measured_signals({*signals, *wheel_pairs(vehicle, signals)}, units, LEARNED)
    if not any(is_of(name, YAW_RATE) for name in outputs):
        raise SignalError(f"yaw_rate.{units[0]}: not among the signals; a learner needs at least one yaw rate, add it")
    setup = Setup.of(vehicle, outputs, settings)
    optional = [name for name in left_out(vehicle) if known_of(name, 0.0, settings).sigma is None]
    omitted = {dynamics.SPEED_DELAY, *(name for name in optional if name not in vehicle.stated)}  # to save time
    setup = replace(setup, unknowns=tuple(u for u in setup.unknowns if u.name not in omitted))
    setup = setup.considering({*setup.without_roll_rate, *_considered(setup)})
    if not setup.estimated_unknowns:
        raise SignalError("given: no unknown is left to estimate; state fewer as exact, or use an Observer")
    return replace(setup, unknowns=(*setup.estimated_unknowns, *setup.considered_unknowns))


def _considered(setup: Setup) -> set[str]:
    """Unknowns that a learner considers, to save time: uncertain ones. What varies from log to log is estimated, so
    that no estimate becomes less certain than it was at the start."""
    varying = {u.name for u in setup.unknowns if u.path.quantity == VARIATION}
    return {u.name for u in setup.unknowns if u.is_uncertain} - varying


def model_of(setup: Setup, outputs: Sequence[str], *, discrepancies: bool) -> OnlineModel:
    """The model with some outputs; with the bank of the road as a state if sensor errors are estimated."""
    parameters = setup.given_to_model(outputs)
    chain = dynamics.model(
        setup.vehicle,
        outputs,
        roll=True,
        bank=setup.bank_sigma > 0,
        extended=True,
        free=tuple(dict.fromkeys(name for u in setup.unknowns for name in u.slopes if name in parameters)),
        tyres=setup.settings.tyre_law,
        braking=True,
    )
    return online_model(chain, setup.unknowns, discrepancies=discrepancies)


def online_model(chain: ChainModel, unknowns: Sequence[Unknown], *, discrepancies: bool) -> OnlineModel:
    """The model with unknowns as parameters; the same object for the same structure.

    Free parameters of the chain are those that the unknowns change; unknowns that change none have no effect.
    """
    structure = tuple((bool(u.moves), tuple(name for name in u.slopes if name in chain.free)) for u in unknowns)
    return _online_model(chain, structure, discrepancies)


@functools.cache
def _online_model(
    chain: ChainModel, unknowns: tuple[tuple[bool, tuple[str, ...]], ...], discrepancies: bool
) -> OnlineModel:
    own = tuple((names[0], i) for i, (moves, names) in enumerate(unknowns) if names and not moves)
    slopes = tuple((name, i) for i, (moves, names) in enumerate(unknowns) if moves for name in names)
    given = tuple(dict.fromkeys(name for name, _ in slopes if name not in dict(own)))
    n, n_d, n_known = len(chain.states), 2 * len(chain.inputs), len(chain.known)
    m = len(chain.outputs) if discrepancies else 0
    p, dt, d = ca.SX.sym("p", len(unknowns)), ca.SX.sym("dt"), ca.SX.sym("d", n_d)
    c = ca.SX.sym("c", n_known + len(given) + len(slopes) + 1)
    value = _values(chain, (own, slopes, given), p, c)
    chain_p, chain_c = ca.vertcat(*[value[name] for name in chain.free]), c[:n_known]
    x, later = ca.SX.sym("x", n + m), ca.SX.sym("later", n + m)
    decay = ca.exp(-dt / c[-1])
    first, last = chain.rates(x[:n], later[:n], dt, d, chain_p, chain_c)
    none = ca.SX.zeros(m, 1)
    y = chain.observation(x[:n], d, chain_p, chain_c)
    exponent = chain.exponent(x[:n], dt, d, chain_p, chain_c)
    by_p, gradients = ca.jacobian(chain_p, p), chain.observation_gradients(x[:n], d, chain_p, chain_c)
    H = ca.horzcat(gradients[:, :n], ca.SX.eye(m)) if m else gradients[:, :n]
    slopes_of_rates = chain.rate_sensitivities(x[:n], later[:n], dt, d, chain_p, chain_c)
    rate_slopes = [ca.vertcat(slope @ by_p, ca.SX(m, len(unknowns))) for slope in slopes_of_rates]
    transition = ca.vertcat(chain.transition(x[:n], dt, d, chain_p, chain_c), decay * x[n:])
    arguments = [x, dt, d, p, c]
    return OnlineModel(
        chain=chain,
        own=own,
        slopes=slopes,
        given=given,
        discrepancies=m,
        identity=(chain.identity, unknowns, discrepancies),
        transition=ca.Function("transition", arguments, [transition]),
        observation=ca.Function("observation", [x, d, p, c], [y + x[n:] if m else y]),
        transition_parts=ca.Function("transition_parts", arguments, [exponent, decay]),
        rates=ca.Function("rates", [x, later, dt, d, p, c], [ca.vertcat(first, none), ca.vertcat(last, none)]),
        rate_slopes=ca.Function("rate_slopes", [x, later, dt, d, p, c], rate_slopes),
        observation_slopes=ca.Function("observation_slopes", [x, d, p, c], [H, gradients[:, n:] @ by_p]),
    )


def _values(chain: ChainModel, structure: Structure, p: ca.SX, c: ca.SX) -> dict[str, ca.SX]:
    """`OnlineModel.values`."""
    (own, slopes, given), n_known = structure, len(chain.known)
    value = dict(zip(chain.known, ca.vertsplit(c[:n_known]), strict=True))
    value |= {name: p[i] for name, i in own} | {name: c[n_known + k] for k, name in enumerate(given)}
    for k, (name, i) in enumerate(slopes):
        value[name] += c[n_known + len(given) + k] * p[i]
    return value
