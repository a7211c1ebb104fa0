"""The discrete-time model against the exact solution of independently derived equations (see lagrangian.py)."""

from collections.abc import Mapping

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import expm

from fifthwheel.base.errors import SignalError
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


@pytest.mark.slow
def test_derivatives_of_the_transition() -> None:
    """Derivatives with respect to state and parameters against central differences of the exact solution."""
    vehicle, dt, speeds = VEHICLES["truck, all changed"], 0.005, (17.0, 18.0)
    values = all_parameters(vehicle, ())
    values |= {path: {"gain": 1.1, "offset": 0.01, "delay": 0.03}[path.rpartition(".")[2]]
               for path in values if path.startswith("steer.")}  # fmt: skip
    softening = {path: value for path, value in values.items() if path.endswith(".softening")}
    free = tuple(path for path in values if path not in softening)
    chain = model(vehicle, (), roll=True, free=free)
    assert chain.free == free
    assert chain.known == tuple(softening)
    x, before, after = random_step(3, chain)
    d = np.r_[speeds[0], before, speeds[1], after]
    arguments = [ca.SX.sym(word, *chain.transition.size_in(i)) for i, word in enumerate(("x", "dt", "d", "p", "c"))]
    transition = chain.transition(*arguments)
    jacobians = ca.Function(
        "J", arguments, [ca.jacobian(transition, arguments[0]), ca.jacobian(transition, arguments[3])]
    )
    by_state, by_parameters = (
        np.array(J) for J in jacobians(x, dt, d, chain.free_values(values), chain.known_values(values))
    )

    def exact(x: Array, values: Mapping[str, float]) -> Array:
        changed_vehicle = vehicle.replace({path: values[path] for path in vehicle.parameters()})
        rate = (after - before) / dt
        gain, offset, delay = (
            np.array([values[f"{signal}.{word}"] for signal in vehicle.steer_signals()])
            for word in ("gain", "offset", "delay")
        )
        angles = [gain * (measured + delay * rate - offset) for measured in (before, after)]
        return exact_state(*by_lagrange(changed_vehicle, chain.states, sum(speeds) / 2), x, angles[0], angles[1], dt)

    scale = typical(chain.states)
    for i, size in enumerate(scale):
        h = size * np.eye(len(x))[i]
        expected = (exact(x + h, values) - exact(x - h, values)) / (2 * size)
        assert np.abs((by_state[:, i] - expected) / scale).max() <= 1e-7 * np.abs(expected / scale).max()
    response = np.abs(exact(x, values) / scale).max()
    for i, path in enumerate(free):
        value = values[path]
        h = 1e-4 * (abs(value) or 1.0)
        plus, minus = (exact(x, values | {path: value + s * h}) for s in (1, -1))
        expected = (plus - minus) / (2 * h) / scale * (abs(value) or 1.0)
        actual = by_parameters[:, i] / scale * (abs(value) or 1.0)
        assert np.abs(actual - expected).max() <= 1e-5 * np.abs(expected).max() + 1e-9 * response, path


def unit_motion(vehicle: Vehicle, states: tuple[str, ...], x: Array, speed: float) -> list[tuple[Array, Array, Array]]:
    """(v, r, p) of every unit from states (N, n); v of the units behind follows from the couplings."""
    state = dict(zip(states, x.T, strict=True))
    zeros = np.zeros(len(x))
    actual = [
        (
            state.get(f"lateral_velocity.{u.name}", zeros),
            state[f"yaw_rate.{u.name}"],
            state.get(f"roll_rate.{u.name}", zeros),
        )
        for u in vehicle.units
    ]
    for i, wheel in enumerate(vehicle.couplings):
        front, rear = vehicle.units[i : i + 2]
        (v, r, p), (_, r2, p2) = actual[i], actual[i + 1]
        v = v + (wheel.leading_position - front.cog) * r - (wheel.height - front.roll_axis_height) * p
        v = v - speed * state[f"articulation.{rear.name}"]
        v = v - (wheel.trailing_position - rear.cog) * r2 + (wheel.height - rear.roll_axis_height) * p2
        actual[i + 1] = (v, r2, p2)
    return actual


@pytest.mark.parametrize(("name", "roll"), [("truck, all changed", False), ("b_double, some relaxation", True)])
class TestSensors:
    """Outputs of sensors with sinusoidal steer angles against a simulation.

    By the library's equations: those of Lagrange, to which `test_lagrangian` compares them, take long for three units.
    """

    speed = 19.0
    h = 1e-3  # s, step of the numerical derivative

    def trajectory(self, vehicle: Vehicle, states: tuple[str, ...]) -> tuple[Array, Array]:
        """States and steer angles at 3 s - h, 3 s and 3 s + h."""
        system = matrices(vehicle, self.speed, roll="roll_rate" in {name.split(".")[0] for name in states})
        assert system.states == states
        A, B = system.A, system.B
        n, k = B.shape
        w = 2.2  # rad/s; the angles are states of an oscillator, so a matrix exponential is exact
        matrix = np.zeros((n + 2 * k, n + 2 * k))
        matrix[:n, :n], matrix[:n, n : n + k] = A, B
        matrix[n : n + k, n + k :], matrix[n + k :, n : n + k] = w * np.eye(k), -w * np.eye(k)
        start = np.r_[np.zeros(n + k), np.linspace(0.02, -0.03, k)]
        out = np.array([expm(matrix * (3.0 + s * self.h)) @ start for s in (-1, 0, 1)])
        return out[:, :n], out[:, n : n + k]

    def outputs(self, vehicle: Vehicle, roll: bool, sensors: dict[str, dict[str, float]]) -> tuple[Array, Array, Array]:
        """Sensor outputs in the middle of the trajectory, the states, and the steer angles."""
        chain = model(vehicle, tuple(sensors), roll=roll)
        errors = {f"{sensor}.{key}": v for sensor, keys in sensors.items() for key, v in keys.items()}
        values = all_parameters(vehicle, chain.outputs) | errors
        x, steer = self.trajectory(vehicle, chain.states)
        d = np.r_[self.speed, steer[0], self.speed, steer[1]]
        return np.array(chain.observation(x[1], d, [], chain.known_values(values))).ravel(), x, steer

    def test_sideslip_and_lateral_velocity(self, name: str, roll: bool) -> None:
        vehicle = VEHICLES[name]
        position = {"position": -2.34, "height": 1.9}
        sensors = {f"sideslip.{u.name}": position | {"offset": 0.003} for u in vehicle.units}
        sensors |= {f"lateral_velocity.{u.name}": {} for u in vehicle.units}
        actual, x, _ = self.outputs(vehicle, roll, sensors)
        states = model(vehicle, (), roll=roll).states
        motion = unit_motion(vehicle, states, x[1:2], self.speed)
        for i, (unit, (v, r, p)) in enumerate(zip(vehicle.units, motion, strict=True)):
            point = v[0] + (-2.34 - unit.cog) * r[0] - (1.9 - unit.roll_axis_height) * p[0]
            assert actual[i] == pytest.approx(point / self.speed + 0.003, rel=1e-9)
            assert actual[len(motion) + i] == pytest.approx(v[0], rel=1e-9)

    def test_coupling_force(self, name: str, roll: bool) -> None:
        """From the front: inertia force and tyre forces of each unit give the force of the coupling behind it."""
        vehicle = VEHICLES[name]
        sensors = {f"coupling_force.{u.name}": dict[str, float]() for u in vehicle.units[1:]}
        actual, x, steer = self.outputs(vehicle, roll, sensors)
        states = model(vehicle, (), roll=roll).states
        angles = dict(zip(vehicle.steer_signals(), steer[1], strict=True))
        front_force = 0.0  # side force of the coupling in front of the unit on the unit
        for i, (v, r, p) in enumerate(unit_motion(vehicle, states, x, self.speed)[:-1]):
            unit = vehicle.units[i]
            rate = [(values[2] - values[0]) / (2 * self.h) for values in (v, r, p)]
            lever = vehicle.derived()[f"{unit.name}.cog_height"] - unit.roll_axis_height
            inertia_force = unit.mass * (rate[0] + self.speed * r[1]) - unit.laden_sprung_mass * lever * rate[2]
            tyres = 0.0
            for group in unit.axle_groups:
                slip = np.mean(
                    [
                        angles.get(f"steer.{unit.name}.{axle.name}", 0.0)
                        - (v[1] + (axle.position - unit.cog) * r[1]) / self.speed
                        for axle in group.axles
                    ]
                )
                lagged = f"slip_angle.{unit.group_path(group)}"
                tyres += group.cornering_stiffness * (x[1, states.index(lagged)] if lagged in states else slip)
            front_force = tyres + front_force - inertia_force
            assert actual[i] == pytest.approx(front_force, rel=1e-4)


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


def test_impossible_models_are_refused() -> None:
    with pytest.raises(SignalError, match="no roll"):
        model(ARTICLE, ("roll_rate.tractor",), roll=False)
    with pytest.raises(SignalError, match="no unit"):
        model(ARTICLE, ("yaw_rate.dolly",), roll=True)
    with pytest.raises(SignalError, match="no such quantity"):
        model(ARTICLE, ("fuel.tractor",), roll=True)
    with pytest.raises(KeyError, match="colour"):
        model(ARTICLE, (), roll=True, free=("tractor.colour",))
    for name in ("articulation.tractor", "coupling_force.tractor"):
        with pytest.raises(SignalError, match="first unit"):
            model(ARTICLE, (name,), roll=True)


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
