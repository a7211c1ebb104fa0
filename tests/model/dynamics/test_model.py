"""The discrete-time model against the exact solution of independently derived equations (see lagrangian.py)."""

from collections.abc import Mapping

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import expm

from fifthwheel.base.options import TyreLaw
from fifthwheel.model.dynamics import ChainModel, all_parameters, matrices, model, simulation
from fifthwheel.truck import Vehicle, get
from tests.model.dynamics.lagrangian import Array, linear
from tests.model.dynamics.test_lagrangian import ARTICLE, TRUCK, VEHICLES, with_relaxation

TYPICAL = {
    "lateral_velocity": 0.5,
    "yaw_rate": 0.1,
    "articulation": 0.05,
    "roll": 0.03,
    "roll_rate": 0.15,
    "slip_angle": 0.02,
}


def typical(states: tuple[str, ...]) -> Array:
    """Typical values of the states in a lane change, to compare errors of different units."""
    return np.array([TYPICAL[name.split(".")[0]] for name in states])


def exact_state(A: Array, B: Array, x: Array, before: Array, after: Array, dt: float) -> Array:
    """The exact x(dt) of x' = A x + B d, where d changes linearly from `before` to `after`."""
    n = len(x)
    matrix = np.zeros((n + 2, n + 2))  # of (x, 1, fraction of the step)
    matrix[:n, :n], matrix[:n, n], matrix[:n, n + 1], matrix[n + 1, n] = A, B @ before, B @ (after - before), 1 / dt
    return np.asarray((expm(matrix * dt) @ np.r_[x, 1.0, 0.0])[:n])


def by_lagrange(vehicle: Vehicle, states: tuple[str, ...], speed: float) -> tuple[Array, Array]:
    actual = linear(vehicle, speed, roll="roll_rate" in {name.split(".")[0] for name in states}).ordered(states)
    return actual.A, actual.B


def random_step(seed: int, chain: ChainModel) -> tuple[Array, Array, Array]:
    """A random state, and random steer angles at both ends of a step."""
    rng = np.random.default_rng(seed)
    k = len(chain.inputs) - 1
    return rng.normal(size=len(chain.states)) * typical(chain.states), *rng.normal(scale=0.03, size=(2, k))


@pytest.mark.parametrize(("speed", "length", "roll"), [(3.0, 0.45, True), (35.0, 0.1, True), (12.0, 0.8, False)])
def test_transition_up_to_the_longest_step(speed: float, length: float, roll: bool) -> None:
    """`simulation.MAX_STEP_EIGENVALUE` keeps the error below 1e-6 of the largest state."""
    vehicle = with_relaxation(VEHICLES["truck, all changed"], length)
    chain = model(vehicle, (), roll=roll)
    constants = chain.known_values(all_parameters(vehicle, ()))
    A, B = by_lagrange(vehicle, chain.states, speed)
    longest = float(simulation.step_limit(vehicle, roll)(np.array([speed]))[0])
    scale = typical(chain.states)
    for dt in (longest, longest / 3, 1e-3):
        for seed in range(5):
            x, before, after = random_step(seed, chain)
            d = np.r_[speed, before, speed, after]
            actual = np.array(chain.transition(x, dt, d, [], constants)).ravel() / scale
            expected = exact_state(A, B, x, before, after, dt) / scale
            assert np.abs(actual - expected).max() <= 1e-6 * np.abs(expected).max()


def test_step_limit_beyond_the_table() -> None:
    """Eigenvalues grow with 1/u below the table and with u above it; the step limit compensates this.

    At the end of the table, the fastest eigenvalue over u is 2.1 % below its limit for high speeds, because the axles
    that roll on their tyres make the lag of the side forces longer. Without this part it is 1.0 % below.
    """
    for speed, tolerance in ((0.2, 0.01), (300.0, 0.022)):
        longest = float(simulation.step_limit(TRUCK, True)(np.array([speed]))[0])
        fastest = np.abs(np.linalg.eigvals(by_lagrange(TRUCK, model(TRUCK, (), roll=True).states, speed)[0])).max()
        assert longest * fastest <= (1 + tolerance) * simulation.MAX_STEP_EIGENVALUE / 1.25


def test_speed_within_a_step_is_the_mean() -> None:
    chain = model(ARTICLE, (), roll=True)
    x, before, after = random_step(1, chain)
    constants = chain.known_values(all_parameters(ARTICLE, ()))
    actual = np.array(chain.transition(x, 0.005, np.r_[19.0, before, 22.0, after], [], constants)).ravel()
    expected = exact_state(*by_lagrange(ARTICLE, chain.states, 20.5), x, before, after, 0.005)
    assert actual == pytest.approx(expected, rel=1e-7, abs=1e-9)


def test_irregular_samples() -> None:
    """Sampling intervals of 2 ms to 0.2 s: there are enough steps, and the state is exact at every sample."""
    vehicle, speed, roll = VEHICLES["truck, all changed"], 22.0, True
    rng = np.random.default_rng(5)
    time = np.cumsum(rng.choice([0.002, 0.01, 0.0137, 0.05, 0.2], size=60)) + 100
    chain = model(vehicle, (), roll=roll)
    steer = {
        signal: 0.03 * np.sin((1.5 + 0.4 * i) * time + i) for i, signal in enumerate(chain.inputs) if signal != "speed"
    }
    inputs = simulation.input_columns({"speed": np.full(len(time), speed), **steer}, chain.inputs)
    limit = simulation.step_limit(vehicle, roll)(inputs[:, 0])
    fine, between, indices = simulation.subdivide(time, inputs, limit)
    assert (fine[indices] == time).all()
    assert (between[indices] == inputs).all()
    dt, d = simulation.step_inputs(fine, between)
    assert (dt[1:] > 0).all()
    assert dt.max() <= limit.min() * (1 + 1e-9)

    constants = chain.known_values(all_parameters(vehicle, ()))
    x, states = np.zeros(len(chain.states)), []
    for step, row in zip(dt, d, strict=True):
        x = np.array(chain.transition(x, step, row, [], constants)).ravel()
        states.append(x)
    actual = np.array(states)[indices]

    A, B = by_lagrange(vehicle, chain.states, speed)
    angles = np.column_stack(list(steer.values()))
    expected = np.zeros_like(actual)
    for i in range(1, len(time)):
        expected[i] = exact_state(A, B, expected[i - 1], angles[i - 1], angles[i], time[i] - time[i - 1])
    assert (np.abs(actual - expected).max(axis=0) <= 1e-6 * np.abs(expected).max(axis=0)).all()


def unit_motion(vehicle: Vehicle, states: tuple[str, ...], x: Array, speed: float) -> list[tuple[float, float, float]]:
    """(v, r, p) of every unit; v of the units behind follows from the couplings. Of x', their derivatives."""
    state = dict(zip(states, x, strict=True))
    motion, v = [], state[f"lateral_velocity.{vehicle.units[0].name}"]
    for i, unit in enumerate(vehicle.units):
        r, p = state[f"yaw_rate.{unit.name}"], state.get(f"roll_rate.{unit.name}", 0.0)
        if i:
            wheel, front, (_, r1, p1) = vehicle.couplings[i - 1], vehicle.units[i - 1], motion[-1]
            v += (wheel.leading_position - front.cog) * r1 - (wheel.height - front.roll_axis_height) * p1
            v -= speed * state[f"articulation.{unit.name}"]
            v -= (wheel.trailing_position - unit.cog) * r - (wheel.height - unit.roll_axis_height) * p
        motion.append((v, r, p))
    return motion


@pytest.mark.parametrize(("name", "roll"), [("truck, all changed", False), ("b_double, some relaxation", True)])
def test_sideslip_and_coupling_force(name: str, roll: bool) -> None:
    """From the front: inertia force and tyre forces of each unit give the force of the coupling behind it.

    By the library's equations: those of Lagrange, to which `test_lagrangian` compares them, take long for three units.
    """
    vehicle, speed = VEHICLES[name], 19.0
    outputs = [f"{quantity}.{u.name}" for quantity in ("sideslip", "lateral_velocity") for u in vehicle.units]
    chain = model(vehicle, (*outputs, *(f"coupling_force.{u.name}" for u in vehicle.units[1:])), roll=roll)
    values = all_parameters(vehicle, chain.outputs)
    for sideslip in outputs[: len(vehicle.units)]:
        values |= {f"{sideslip}.position": -2.34, f"{sideslip}.height": 1.9, f"{sideslip}.offset": 0.003}
    x, steer, _ = random_step(7, chain)
    observed = np.array(chain.observation(x, np.r_[speed, steer, speed, steer], [], chain.known_values(values))).ravel()
    actual = dict(zip(chain.outputs, observed, strict=True))
    system, state = matrices(vehicle, speed, roll=roll), dict(zip(chain.states, x, strict=True))
    motion, change = (unit_motion(vehicle, system.states, y, speed) for y in (x, system.A @ x + system.B @ steer))
    angles = dict(zip(vehicle.steer_signals(), steer, strict=True))
    force = 0.0  # side force of the coupling in front of the unit on the unit
    for i, (unit, (v, r, p), rate) in enumerate(zip(vehicle.units, motion, change, strict=True)):
        point = v + (-2.34 - unit.cog) * r - (1.9 - unit.roll_axis_height) * p
        assert actual[f"sideslip.{unit.name}"] == pytest.approx(point / speed + 0.003, rel=1e-9)
        assert actual[f"lateral_velocity.{unit.name}"] == pytest.approx(v, rel=1e-9)
        if i:
            assert actual[f"coupling_force.{unit.name}"] == pytest.approx(force, rel=1e-9)
        lever = vehicle.derived()[f"{unit.name}.cog_height"] - unit.roll_axis_height
        force -= unit.mass * (rate[0] + speed * r) - unit.laden_sprung_mass * lever * rate[2]
        for group in unit.axle_groups:
            steered = [angles.get(f"steer.{unit.name}.{axle.name}", 0.0) for axle in group.axles]
            slip = np.mean(steered) - (v + (group.position - unit.cog) * r) / speed
            slip = state.get(f"slip_angle.{unit.group_path(group)}", slip)
            force += group.cornering_stiffness * slip


def test_delay_gain_and_offset_of_a_steer_sensor() -> None:
    """A sensor that shows (angle / gain + offset) with a delay: the model corrects all three errors, the output of an
    accelerometer gain and offset."""
    signal, delay = "steer.tractor.front", 0.1
    chain = model(ARTICLE, ("lateral_acceleration.tractor",), roll=True)
    values = all_parameters(ARTICLE, chain.outputs)
    errors = {f"{signal}.gain": 1.25, f"{signal}.offset": 0.02}
    x, _, _ = random_step(4, chain)
    dt, slope = 0.01, 0.3  # rad/s
    angles = [np.array([slope * t, 0, 0, 0]) for t in (0.0, dt)]

    def shown(delay: float) -> list[Array]:
        return [np.array([slope * (t - delay) / 1.25 + 0.02, 0, 0, 0]) for t in (0.0, dt)]

    def results(pair: list[Array], values: Mapping[str, float]) -> list[Array]:
        d, c = np.r_[20.0, pair[0], 20.0, pair[1]], chain.known_values(values)
        return [np.array(y).ravel() for y in (chain.transition(x, dt, d, [], c), chain.observation(x, d, [], c))]

    expected, late, now = (
        results(angles, values),
        results(shown(delay), values | errors | {f"{signal}.delay": delay}),
        results(shown(0.0), values | errors),
    )
    assert late[0] == pytest.approx(expected[0], rel=1e-9, abs=1e-12)
    assert now[1] == pytest.approx(expected[1], rel=1e-9)


# Rates at both ends of a step


RATED = ("yaw_rate.tractor", "roll_rate.semitrailer")
RATED_FREE = ("tractor.front.cornering_stiffness", "semitrailer.payload.height", "steer.tractor.front.delay")


@pytest.fixture(scope="module")
def rated() -> ChainModel:
    truck = get("cheng_cebon_2011").with_logged_steering({"steer.tractor.front"}, "the test")
    return model(truck, RATED, roll=True, bank=True, free=RATED_FREE)


def test_mean_rate_is_the_slope_of_the_state(rated: ChainModel) -> None:
    rng = np.random.default_rng(0)
    x, h = 0.05 * rng.normal(size=len(rated.states)), 1e-5
    values = all_parameters(rated.vehicle, RATED)
    p, c, d = rated.free_values(values), rated.known_values(values), np.array([20.0, 0.01, 20.0, 0.01])
    later = np.array(rated.transition(x, h, d, p, c)).ravel()
    first, last = (np.array(rate).ravel() for rate in rated.rates(x, later, h, d, p, c))
    np.testing.assert_allclose((first + last) / 2, (later - x) / h, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("tyres", ["linear", "saturating"])
def test_sensitivities_of_the_rates_are_their_derivatives(tyres: TyreLaw) -> None:
    """Without those of the inverse mass matrix; of an extended model, whose stiffness depends on the slip."""
    truck = get("cheng_cebon_2011").with_logged_steering({"steer.tractor.front"}, "the test")
    free = (*RATED_FREE, "tractor.mass", "tractor.cog", "semitrailer.yaw_inertia")
    free += ("tractor.front.softening",) if tyres == "linear" else ()
    rated = model(truck, RATED, roll=True, bank=True, free=free, extended=True, tyres=tyres)
    values = all_parameters(truck, RATED, extended=True, tyres=tyres) | {"tractor.front.softening": 2.0}
    n, k = len(rated.states), 2 * len(rated.inputs)
    d, rng = np.zeros(k), np.random.default_rng(2)
    d[[0, k // 2]], d[[1, k // 2 + 1]] = (20.0, 20.5), (0.01, 0.012)
    symbols = [ca.SX.sym("a", size) for size in (n, n, 1, k, len(free), len(rated.known))]
    exact = ca.Function("exact", symbols, [ca.jacobian(rate, symbols[4]) for rate in rated.rates(*symbols)])
    at = 0.02 * rng.normal(size=n), 0.02 * rng.normal(size=n), 0.01, d, rated.free_values(values)
    for actual, expected in zip(
        rated.rate_sensitivities(*at, rated.known_values(values)), exact(*at, rated.known_values(values)), strict=True
    ):
        size = np.abs(np.array(expected)).max(axis=0) + 1e-12
        np.testing.assert_allclose(np.array(actual) / size, np.array(expected) / size, atol=1e-10)
