"""The chain as a discrete-time model for filters: x+ = f(x, dt, d, p, c), y = h(x, d, p, c).

Within a step the speed and its derivative are constant at their means, and the steer angles change linearly from the
previous sample to this one. The step is the Taylor series of the exact solution; its error is below 1e-6 if dt is
within `simulation.StepLimit`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np

from fifthwheel.base.lazy import lazy
from fifthwheel.base.types import Array
from fifthwheel.data.channels import SignalName, channel_of, own_channels
from fifthwheel.model.dynamics import chain, sensors, tyres
from fifthwheel.model.dynamics import steering as steered
from fifthwheel.model.dynamics.large_angles import LargeAngles, large_angles
from fifthwheel.model.dynamics.steering import PLAY, SteeringSlopes, Wheels, steer_parameters, true_angles
from fifthwheel.model.dynamics.symbolic import Expressions, Stages, exponential_step, taylor, transition_matrix
from fifthwheel.model.dynamics.tyres import (
    NO_CHANGE,
    Tyres,
    law_of,
    saturation_parameters,
    softening_factor,
    softening_parameters,
)
from fifthwheel.model.dynamics.unit_equations import BANK, Motion, slip_angles
from fifthwheel.truck import Vehicle
from fifthwheel.truck.quantities import DRIVE_AXLE_BRAKING


@dataclass(frozen=True, kw_only=True, eq=False)
class ChainModel:
    """The discrete-time model of a chain of units; built by `model`.

    x is the state (n,), d = [speed and steer angles at the previous sample, speed and steer angles at this sample]
    (2 k,), p the free parameters and c all other parameters. Steer angles are as measured.
    """

    vehicle: Vehicle  # gives the structure; its numbers are not used, p and c hold them
    roll: bool  # yaw and roll, or yaw only
    bank: bool  # whether the bank of the road is a state
    extended: bool  # whether it has the parameters of `extension_parameters`
    tyres: Tyres  # not linear: with the parameters of `tyres.saturation_parameters`
    braking: bool  # whether `SPEED_RATE` is an input
    long_steps: bool  # by `exponential_step`
    outputs: tuple[str, ...]  # names of y
    free: tuple[str, ...]  # names of p

    @lazy
    def states(self) -> tuple[str, ...]:
        """Names of x (n,)."""
        return chain.state_names(self.vehicle, roll=self.roll, bank=self.bank)

    @lazy
    def inputs(self) -> tuple[str, ...]:
        """Names (k,): speed, steer signals, extended: `contact_input` and `rate_input` of each, SLOPES, SPEED_RATE."""
        steers = self.vehicle.steer_signals()
        extension = (*map(contact_input, steers), *map(rate_input, steers)) if self.extended else ()
        speeds = ("speed", SPEED_RATE) if self.braking else ("speed",)
        slopes = [SLOPES[name] for name in speeds] if SPEED_DELAY in self.free else []
        return ("speed", *steers, *extension, *slopes, *speeds[1:])

    @lazy
    def known(self) -> tuple[str, ...]:
        """Names of c."""
        names = all_parameters(self.vehicle, self.outputs, extended=self.extended, tyres=self.tyres)
        return tuple(name for name in names if name not in self.free)

    @lazy
    def identity(self) -> tuple[object, ...]:
        """All that determines the functions."""
        laws = self.bank, self.extended, tyres.law_identity(self.tyres), self.braking, self.long_steps
        own = own_channels(self.outputs)  # no plain values: the step is built in every process
        return topology(self.vehicle), self.outputs, self.roll, self.free, *laws, own

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """Numbers of elements of x, d, p, c and y."""
        return len(self.states), 2 * len(self.inputs), len(self.free), len(self.known), len(self.outputs)

    @lazy
    def transition(self) -> ca.Function:
        """(x, dt, d, p, c) -> x+, the state dt seconds later; equations (2) and (3) of Cheng and Cebon (2011)."""
        s, m = self._symbols, self._motion
        if self.long_steps:
            x, steer = ca.SX.sym("x", s.x.shape[0]), ca.SX.sym("steer", s.steering.start.shape[0])
            others = s.dt, s.d, s.p, s.c
            rate = ca.Function("rate", [x, steer, *others], [m.rate(x, steer)])  # built once, called at four places
            ends = s.steering.start, s.steering.end
            later = exponential_step(lambda x, d: rate(x, d, *others), s.x, self._decay, *ends, s.duration)
            return s.step("transition", later, "x_next")
        change = m.B @ (s.steering.end - s.steering.start)
        return s.step("transition", taylor(m.A, s.x, m.rates[0], change, s.duration), "x_next")

    @lazy
    def state_jacobian(self) -> ca.Function:
        """(x, dt, d, p, c) -> dx+/dx (n, n), the state transition matrix."""
        s = self._symbols
        return s.step("state_jacobian", transition_matrix(self._motion.A * s.duration), "F")

    @lazy
    def exponent(self) -> ca.Function:
        """(x, dt, d, p, c) -> M (n, n), of which `state_jacobian` is the `transition_matrix`."""
        s = self._symbols
        return s.step("exponent", self._motion.A * s.duration, "M")

    @lazy
    def steer_offset_exponent(self) -> ca.Function:
        """(x, dt, d, p, c) -> further columns (n, m) of M for the offsets of the m steer angles as constant states."""
        s = self._symbols
        return s.step("steer_offset_exponent", -self._motion.B @ s.steering.slope * s.duration, "M_steer")

    @lazy
    def rates(self) -> ca.Function:
        """(x, x+, dt, d, p, c) -> x' at the beginning and at the end of a step."""
        s, rates = self._symbols, list(map(ca.densify, self._motion.rates))
        arguments, names = [s.x, s.later, s.dt, s.d, s.p, s.c], ["x", "x_next", "dt", "d", "p", "c"]
        return ca.Function("rates", arguments, rates, names, ["rate", "rate_next"])

    @lazy
    def rate_sensitivities(self) -> ca.Function:
        """(x, x+, dt, d, p, c) -> derivatives (n, n_p) of both `rates` with respect to p."""
        s, m = self._symbols, self._motion
        slopes = [m.rate_stages.jacobian(rate, s.p) for rate in m.staged_rates]
        return ca.Function("rate_sensitivities", [s.x, s.later, s.dt, s.d, s.p, s.c], slopes)

    @lazy
    def observation(self) -> ca.Function:
        """(x, d, p, c) -> y; equation (4) of Cheng and Cebon (2011)."""
        return self._symbols.instant("observation", ca.densify(self._motion.stages.expanded(self._y)), "y")

    @lazy
    def observation_jacobian(self) -> ca.Function:
        """(x, d, p, c) -> dy/dx"""
        s = self._symbols
        return s.instant("observation_jacobian", self._motion.stages.jacobian(self._y, s.x), "H")

    @lazy
    def observation_sensitivity(self) -> ca.Function:
        """(x, d, p, c) -> dy/dp"""
        s = self._symbols
        return s.instant("observation_sensitivity", self._motion.stages.jacobian(self._y, s.p), "H_p")

    @lazy
    def observation_gradients(self) -> ca.Function:
        """(x, d, p, c) -> dy/d[x, p], in which no derivative is neglected"""
        s, by = self._symbols, ca.vertcat(self._symbols.x, self._symbols.p)
        if self.tyres == "linear":
            rows = [self._motion.stages.gradient(y, by).T for y in ca.vertsplit(self._y)]
            return s.instant("observation_gradients", ca.vertcat(*rows), "gradients")
        # second derivatives of tyres that saturate have more operations than the adjoint method saves
        y = self._motion.stages.expanded(self._y)
        return s.instant("observation_gradients", ca.jacobian(y, by), "gradients")

    @lazy
    def _symbols(self) -> "_Symbols":
        return _symbols(self)

    @lazy
    def _motion(self) -> "_Motion":
        return (_linear if self.tyres == "linear" else _saturating)(self, self._symbols)

    @lazy
    def _y(self) -> ca.SX:
        """Outputs with variables of the stages."""
        return ca.vertcat(ca.SX(0, 1), *[sensors.sensor_output(self._motion.sensed, name) for name in self.outputs])

    @property
    def _decay(self) -> ca.SX:
        """Rate at which each state lags (n,), 1/s: that of the side forces behind their slip angles."""
        decay, speed, k = ca.SX.zeros(len(self.states)), self._symbols.inputs, len(self.inputs)
        for path in chain.relaxation_groups(self.vehicle):
            length = self._symbols.value[f"{path}.relaxation_length"]
            decay[self.states.index(f"slip_angle.{path}")] = (speed[0] + speed[k]) / 2 / length
        return decay

    def known_values(self, values: Mapping[str, float]) -> Array:
        """c from values by name, SI."""
        return np.array([values[name] for name in self.known], dtype=np.float64)

    def free_values(self, values: Mapping[str, float]) -> Array:
        """p from values by name, SI."""
        return np.array([values[name] for name in self.free], dtype=np.float64)


CONTACT = "contact"
"""Quantity of `contact_input`."""
STEER_RATE = "steer_rate"
"""Quantity of `rate_input`."""
SPEED_RATE = "speed_rate"
"""Input of a model that brakes: the derivative of the speed, and g sin(grade) where the grade is known, m/s^2."""
SPEED_DELAY = "speed.delay"
"""Delay of the speed, s, a parameter of an extended model."""
SLOPES = {"speed": "speed_slope", SPEED_RATE: "speed_rate_slope"}
"""Inputs of a model with a free `SPEED_DELAY`: derivatives of the measured speed and of its rate, m/s^2 and m/s^3."""
TIME_SCALE = "time_base.scale"
"""True duration of a second of the log, a parameter of an extended model."""


def extension_parameters(vehicle: Vehicle, outputs: Sequence[str]) -> dict[str, float]:
    """Parameters of an extended model, with the defaults at which it is the plain model.

    They describe what a plain model leaves out, so that an estimator can state its effect:

        <steer angle>.play       rad; the wheels lag behind the steering by half of it, to the side of `contact`
        <sensor>.delay           s, latency of the speed, a gyro, accelerometer or articulation sensor, to first order
        time_base.scale          true duration of a second of the log
    """
    values = {f"{name}.{PLAY}": 0.0 for name in vehicle.steer_signals()}
    with_rate = [name for name in outputs if (channel := channel_of(name)) and channel.model and channel.model.rate]
    values |= {SPEED_DELAY: 0.0} | {f"{name}.delay": 0.0 for name in with_rate}
    return values | {TIME_SCALE: 1.0}


def contact_input(steer: str) -> str:
    """Name of an input of an extended model, contact.<unit>.<axle>: the side on which the play of a steering is in
    contact, -0.5 to 0.5."""
    return f"{CONTACT}.{SignalName.of(steer).place}"


def rate_input(steer: str) -> str:
    """Name of an input of an extended model, steer_rate.<unit>.<axle>: derivative of a measured steer angle, rad/s."""
    return f"{STEER_RATE}.{SignalName.of(steer).place}"


def all_parameters(
    vehicle: Vehicle, outputs: Sequence[str], *, extended: bool = False, tyres: Tyres = "linear"
) -> dict[str, float]:
    """Every parameter of a model with these outputs, by name: those of the vehicle, who brakes, and the defaults of the
    sensors."""
    of_tyres = softening_parameters(vehicle) if tyres == "linear" else saturation_parameters(vehicle, tyres)
    values = vehicle.parameters() | steer_parameters(vehicle) | {DRIVE_AXLE_BRAKING: 0.0} | of_tyres
    for name in outputs:
        values |= sensors.sensor_parameters(vehicle, name)
    return values | extension_parameters(vehicle, outputs) if extended else values


def topology(vehicle: Vehicle) -> tuple[object, ...]:
    """Structure of a vehicle, without its numbers; vehicles of equal topology share one model."""
    payloads = tuple(unit.payload.shape if unit.payload else None for unit in vehicle.units)
    lifted = tuple(axle.lifted for unit in vehicle.units for axle in unit.axles)
    own = vehicle.steering and (vehicle.steering.trace.digest, tuple(vehicle.steering.states))
    names = tuple(vehicle.parameters()), vehicle.steer_signals()
    kinds, driven = tuple(coupling.kind for coupling in vehicle.couplings), vehicle.driven_groups()[-1]
    return (*names, payloads, kinds, driven, chain.relaxation_groups(vehicle), lifted, own)


_models: dict[tuple[object, ...], ChainModel] = {}


def model(
    vehicle: Vehicle,
    outputs: Sequence[str],
    *,
    roll: bool,
    free: Sequence[str] = (),
    bank: bool = False,
    extended: bool = False,
    tyres: Tyres = "linear",
    braking: bool = False,
    long_steps: bool = False,
) -> ChainModel:
    """The discrete-time model of a vehicle; vehicles of equal topology share one model.

    Args:
        vehicle: units, axles and couplings.
        outputs: signals such as "yaw_rate.tractor"; "bank.road" if the bank is a state.
        roll: yaw and roll, or yaw only.
        free: parameters for p, by the names in `all_parameters`; all others go to c.
        bank: whether the bank of the road is a state.
        extended: whether the model has the parameters of `extension_parameters`.
        tyres: law of their side forces, also a user's own, see `model.dynamics.tyres`.
        braking: whether the derivative of the speed is an input, `SPEED_RATE`; without it, the speed changes slowly.
        long_steps: whether a step may last several times as long, by `exponential_step`. Such a model has no
            `state_jacobian`.

    Raises:
        SignalError: the vehicle or the yaw-only model does not have an output.
        KeyError: a free parameter does not exist.
    """
    for name in outputs:
        if name == BANK and bank:
            continue
        sensors.require_available(vehicle, name, roll=roll)
    new = ChainModel(
        vehicle=vehicle,
        roll=roll,
        bank=bank,
        extended=extended,
        tyres=tyres,
        braking=braking,
        long_steps=long_steps,
        outputs=tuple(outputs),
        free=tuple(free),
    )
    if new.identity not in _models:
        unknown = set(free) - set(all_parameters(vehicle, outputs, extended=extended, tyres=tyres))
        if unknown:
            raise KeyError(f"no such parameters: {sorted(unknown)}")
    return _models.setdefault(new.identity, new)


class _Steering(NamedTuple):
    """Steer angles of the wheels of a step, rad."""

    start: ca.SX  # at its beginning, as of the delayed signal (m,)
    end: ca.SX  # at its end (m,)
    now: dict[str, ca.SX]  # at its end without the correction of a delay, by signal
    rate: ca.SX  # derivatives of the measured angles (m,), rad/s; 0 in a plain model
    measured: ca.SX  # at its end (m,)
    slope: ca.SX  # derivatives of the angles at its end with respect to the measured ones (m, m)


class _Motion(NamedTuple):
    """The linearised motion during a step, and what sensors see at its end."""

    A: ca.SX  # (n, n)
    B: ca.SX  # (n, m)
    rate: Callable[[ca.SX, ca.SX], ca.SX]  # x' (n,) of a state and steer angles (m,), with the mean speed
    rates: tuple[ca.SX, ca.SX]  # at the beginning and at the end (n,)
    staged_rates: tuple[ca.SX, ca.SX]  # the same with variables of stages, for derivatives
    rate_stages: Stages
    sensed: sensors.SensorInputs
    stages: Stages  # of what sensors see


class _Symbols(NamedTuple):
    """The symbols of a model, and what depends on them alone."""

    x: ca.SX
    later: ca.SX  # x+
    dt: ca.SX
    d: ca.SX
    p: ca.SX
    c: ca.SX
    value: dict[str, ca.SX]  # of the parameters, by name
    inputs: ca.SX  # d with the speed of the truck
    steering: _Steering
    duration: ca.SX  # true one of dt, s

    def step(self, name: str, result: ca.SX, output: str) -> ca.Function:
        """(x, dt, d, p, c) -> result, named"""
        arguments = [self.x, self.dt, self.d, self.p, self.c]
        return ca.Function(name, arguments, [result], ["x", "dt", "d", "p", "c"], [output])

    def instant(self, name: str, result: ca.SX, output: str) -> ca.Function:
        """(x, d, p, c) -> result, named"""
        return ca.Function(name, [self.x, self.d, self.p, self.c], [result], ["x", "d", "p", "c"], [output])


def _symbols(model: ChainModel) -> _Symbols:
    n, k = len(model.states), len(model.inputs)
    p, c = ca.SX.sym("p", len(model.free)), ca.SX.sym("c", len(model.known))
    x, later, dt, d = ca.SX.sym("x", n), ca.SX.sym("later", n), ca.SX.sym("dt"), ca.SX.sym("d", 2 * k)
    value = dict(zip((*model.free, *model.known), ca.vertsplit(ca.vertcat(p, c)), strict=True))
    duration = dt * value[TIME_SCALE] if model.extended else dt
    return _Symbols(x, later, dt, d, p, c, value, _inputs(model, value, d), _steering(model, value, d, dt), duration)


def _inputs(model: ChainModel, value: Expressions, d: ca.SX) -> ca.SX:
    """The inputs with the speed of the truck and its rate, from the measured ones and their delay."""
    inputs, names = ca.SX(d), model.inputs
    for name, slope in SLOPES.items():
        for first in (0, len(names)) if slope in names else ():
            inputs[first + names.index(name)] += value[SPEED_DELAY] * d[first + names.index(slope)]
    return inputs


def _steering(model: ChainModel, value: Expressions, d: ca.SX, dt: ca.SX) -> _Steering:
    """The steer angles, from the measured ones and the errors of their sensors."""
    steers, k = model.vehicle.steer_signals(), len(model.inputs)
    m = len(steers)
    play, delay = (ca.vertcat(*[value.get(f"{name}.{kind}", 0.0) for name in steers]) for kind in (PLAY, "delay"))
    before, after = d[1 : m + 1], d[k + 1 : k + m + 1]
    if model.extended:
        contact_before, rate_before = d[m + 1 : 2 * m + 1], d[2 * m + 1 : 3 * m + 1]
        contact, rate = d[k + m + 1 : k + 2 * m + 1], d[k + 2 * m + 1 : k + 3 * m + 1]
        start = true_angles(steers, before + delay * rate_before, value) - play * contact_before
        end = now = true_angles(steers, after + delay * rate, value) - play * contact
    else:
        rate, shift = ca.SX.zeros(m), delay * (after - before) / ca.fmax(dt, 1e-3)
        start, end, now = (true_angles(steers, each, value) for each in (before + shift, after + shift, after))
    by_name = dict(zip(steers, ca.vertsplit(now), strict=True)) if steers else {}
    return _Steering(start, end, by_name, rate, after, ca.jacobian(now, after))


def _softening(
    model: ChainModel, s: _Symbols, state: ca.SX, speed: ca.SX, steer: Expressions
) -> tuple[dict[str, ca.SX], dict[str, ca.SX]]:
    """Factors of the cornering stiffnesses by name; all parameters with them."""
    value = s.value
    motion = Motion.of(value, model.vehicle, _by_name(model, state), speed)
    slips = slip_angles(value, model.vehicle, motion, steer)
    factors = {
        f"{path}.cornering_stiffness": softening_factor(value[f"{path}.softening"], slip)
        for path, slip in slips.items()
    }
    return factors, value | {name: value[name] * factor for name, factor in factors.items()}


def _linear(model: ChainModel, s: _Symbols) -> _Motion:
    """With linear tyres: the chain, with linear equations of the steering."""
    vehicle, roll, bank, k = model.vehicle, model.roll, model.bank, len(model.inputs)
    now = s.inputs[k]
    angles, turning = ca.vertcat(*s.steering.now.values()), (s.steering.measured, s.steering.rate)
    wheels = chain.linear_wheels(s.value, vehicle, _by_name(model, s.x), now, angles)
    factors, softened = _softening(model, s, s.x, now, wheels)
    equations = chain.equations(s.value, vehicle, roll=roll, bank=bank, stiffness_factors=factors)
    mean, change, latest = (s.inputs[0] + now) / 2, None, None
    if model.braking:
        rates_of_speed = (s.inputs[k - 1] + s.inputs[2 * k - 1]) / 2, s.inputs[2 * k - 1]
        change, latest = (chain.SpeedChange.of(rate, s.value[DRIVE_AXLE_BRAKING]) for rate in rates_of_speed)
    A, B = equations.state_space(mean, change)
    stages, rate_stages = Stages(), Stages()
    sensed = sensors.sensor_inputs(
        softened,
        vehicle,
        equations,
        s.x,
        now,
        angles,
        roll=roll,
        bank=bank,
        turning=turning,
        stages=stages,
        change=latest,
    )

    def rate(state: ca.SX, steer: ca.SX) -> ca.SX:
        """With the softening there."""
        at = chain.linear_wheels(s.value, vehicle, _by_name(model, state), mean, steer)
        factors, _ = _softening(model, s, state, mean, at)
        there = chain.equations(s.value, vehicle, roll=roll, bank=bank, stiffness_factors=factors)
        F, G = there.state_space(mean, change)
        return F @ state + G @ steer

    rates = A @ s.x + B @ s.steering.start, A @ s.later + B @ s.steering.end
    first = equations.rates(mean, s.x, s.steering.start, rates[0], rate_stages, change)
    last = equations.rates(mean, s.later, s.steering.end, rates[1], rate_stages, change)
    return _Motion(A, B, rate, rates, (first, last), rate_stages, sensed, stages)


def _saturating(model: ChainModel, s: _Symbols) -> _Motion:
    """With tyres that saturate: the equations with rotations, linearised at the beginning of the step."""
    k, d, steering, law = len(model.inputs), s.inputs, s.steering, law_of(model.tyres)
    vehicle, roll, bank, commands = model.vehicle, model.roll, model.bank, ca.vertcat(*s.steering.now.values())

    def wheels(state: ca.SX, speed: ca.SX, steer: ca.SX) -> Wheels:
        return steered.wheels(s.value, vehicle, _by_name(model, state), speed, steer)

    last = wheels(s.x, d[k], commands)

    def motion(state: ca.SX, speed: ca.SX, angles: Expressions, speed_rate: ca.SX) -> LargeAngles:
        return large_angles(
            s.value, vehicle, state, speed, angles, roll=roll, bank=bank, speed_rate=speed_rate, law=law
        )

    earlier, latest = (d[k - 1], d[2 * k - 1]) if model.braking else (NO_CHANGE, NO_CHANGE)
    mean, change = (d[0] + d[k]) / 2, (earlier + latest) / 2
    before = wheels(s.x, mean, steering.start)
    angles = ca.SX.sym("angles", len(before.angles))
    symbols = dict(zip(before.angles, ca.vertsplit(angles), strict=True)) if before.angles else {}
    begin = motion(s.x, mean, symbols, change)
    slopes = begin.stages.jacobian(begin.rates, ca.vertcat(s.x, angles))
    A, B, first = (
        ca.substitute(matrix, angles, before.stacked)
        for matrix in (*ca.horzsplit(slopes, [0, s.x.shape[0], slopes.shape[1]]), begin.stages.expanded(begin.rates))
    )
    if vehicle.steering:
        symbol = ca.SX.sym("steer", commands.shape[0])
        by = steered.slopes(s.value, vehicle, _by_name(model, s.x), mean, symbol)
        A, B = SteeringSlopes(*[ca.substitute(part, symbol, steering.start) for part in by]).applied(A, B)
    now = motion(s.x, d[k], last.angles, latest)
    sensed = sensors.SensorInputs(
        p=s.value,
        vehicle=vehicle,
        motion=now.motion,
        acceleration=now.acceleration,
        speed=d[k],
        steer=last.angles,
        side_force=now.side_force,
        load_change=now.load_change,
        roll=roll,
        states=_by_name(model, s.x),
        rate_of=now.stages.rate(ca.vertcat(s.x, steering.measured), ca.vertcat(now.rates + last.rates, steering.rate)),
        ahead=now.stages.ahead(s.x, now.rates + last.rates),
    )

    def rate(state: ca.SX, steer: ca.SX) -> ca.SX:
        at = wheels(state, mean, steer)
        moving = motion(state, mean, at.angles, change)
        return moving.stages.expanded(moving.rates) + at.rates

    rates = first + before.rates, rate(s.later, steering.end)
    return _Motion(A, B, rate, rates, rates, Stages(), sensed, now.stages)


def _by_name(model: ChainModel, x: ca.SX) -> dict[str, ca.SX]:
    return dict(zip(model.states, ca.vertsplit(x), strict=True))
