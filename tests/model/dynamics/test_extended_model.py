"""The extended model against the plain one: each additional parameter has the effect that its name says."""

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.filters.step_rows import corrected_inputs
from fifthwheel.model.dynamics import TIME_SCALE, ChainModel, all_parameters, matrices, model
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.truck import Vehicle
from tests.model.dynamics.lagrangian import Array, axle_compliance
from tests.model.dynamics.test_lagrangian import TRUCK, VEHICLES, with_relaxation
from tests.model.dynamics.test_model import typical

STEER = "steer.tractor.front"
YAW, ROLL, ANGLE = "yaw_rate.tractor", "roll_rate.semitrailer", "articulation.semitrailer"
SENSORS = (YAW, "yaw_rate.semitrailer", "roll_rate.tractor", ROLL, ANGLE)
LOGGED = TRUCK.with_logged_steering({STEER}, "the test")
SPEED, DT = 21.0, 0.005


def sample(chain: ChainModel, seed: int = 1) -> tuple[Array, Array]:
    """A random state, and inputs at both ends of a step: speed, steer angles, and zeros for contacts and rates."""
    rng, m = np.random.default_rng(seed), len(chain.vehicle.steer_signals())
    x = rng.normal(size=len(chain.states)) * typical(chain.states)
    ends = [np.r_[SPEED, angles, np.zeros(len(chain.inputs) - 1 - m)] for angles in rng.normal(scale=0.03, size=(2, m))]
    return x, np.concatenate(ends)


def step(chain: ChainModel, x: Array, d: Array, values: dict[str, float], dt: float = DT) -> tuple[Array, Array]:
    """The state after a step and the outputs before it."""
    c = chain.known_values(values)
    return np.array(chain.transition(x, dt, d, [], c)).ravel(), np.array(chain.observation(x, d, [], c)).ravel()


def both(vehicle: Vehicle, outputs: tuple[str, ...], *, roll: bool = True) -> tuple[ChainModel, ChainModel]:
    return model(vehicle, outputs, roll=roll), model(vehicle, outputs, roll=roll, extended=True)


@pytest.mark.slow
@pytest.mark.parametrize(("roll", "braking"), [(False, False), (True, True)])
def test_with_its_defaults_it_is_the_plain_model(roll: bool, braking: bool) -> None:
    """Also with saturating tyres while it brakes: the derivative of the speed is the last input."""
    vehicle, tyres = VEHICLES["truck, all changed"], "saturating" if braking else "linear"
    last = vehicle.units[-1].name
    outputs = (f"yaw_rate.{last}", f"articulation.{last}", f"lateral_acceleration.{last}")
    plain, extended = (
        model(vehicle, outputs, roll=roll, extended=extended, tyres=tyres, braking=braking)
        for extended in (False, True)
    )
    x, d = sample(plain)
    k, m = len(plain.inputs), len(extended.inputs)
    wider, results = np.full(2 * m, 0.3), []  # contacts and rates have no effect
    for rates in ((-3.0, -2.0), (-2.0, -2.0)) if braking else (d[[k - 1, 2 * k - 1]],):
        for end, rate in enumerate(rates):
            d[end * k + k - 1] = rate
            wider[end * m : end * m + k], wider[end * m + m - 1] = d[end * k : end * k + k], rate if braking else 0.3
        expected = step(plain, x, d, all_parameters(vehicle, outputs, tyres=tyres))
        actual = step(extended, x, wider, all_parameters(vehicle, outputs, extended=True, tyres=tyres))
        for one, other in zip(actual, expected, strict=True):
            assert one == pytest.approx(other, rel=1e-12, abs=1e-14)
        results.append(actual)
    if braking:  # both ends of a step count; the sensors see its end
        assert np.abs(results[1][0] - results[0][0]).max() > 1e-5
        assert (results[1][1] == results[0][1]).all()


@pytest.mark.slow
def test_softening_reduces_the_stiffness_at_a_slip_angle() -> None:
    """The plain model with C / (1 + s |alpha|), alpha from the kinematics of the axles or the lagged slip angle.

    The relaxation length stays that of the vehicle file's C, of which C h^2 / (K + K_t) is a part.
    """
    vehicle = with_relaxation(TRUCK, 0.0, 0.52, 0.0)
    plain, extended = both(vehicle, ("lateral_acceleration.tractor",))
    x, d = sample(extended)
    assert {f"{u.group_path(g)}.softening" for u in vehicle.units for g in u.axle_groups} <= {*plain.known}
    state = dict(zip(extended.states, x, strict=True))
    after = dict(zip(extended.inputs, d[len(extended.inputs) :], strict=True))
    values = all_parameters(vehicle, plain.outputs, extended=True)
    softer, lateral, heading, front = dict(values), state["lateral_velocity.tractor"], 0.0, vehicle.units[0]
    for i, unit in enumerate(vehicle.units):
        if i:
            coupling, r1, r2 = vehicle.couplings[i - 1], state[f"yaw_rate.{front.name}"], state[f"yaw_rate.{unit.name}"]
            p1, p2 = state[f"roll_rate.{front.name}"], state[f"roll_rate.{unit.name}"]
            lateral += (coupling.leading_position - front.cog) * r1 - (coupling.trailing_position - unit.cog) * r2
            lateral -= (coupling.height - front.roll_axis_height) * p1 - (coupling.height - unit.roll_axis_height) * p2
            heading += state[f"articulation.{unit.name}"]
            front = unit
        for group in unit.axle_groups:
            path = unit.group_path(group)
            slips = [
                after.get(f"steer.{unit.name}.{axle.name}", 0.0)
                + heading
                - (lateral + (axle.position - unit.cog) * state[f"yaw_rate.{unit.name}"]) / SPEED
                for axle in group.axles
            ]
            slip = abs(state.get(f"slip_angle.{path}", np.mean(slips)))
            values[f"{path}.softening"] = softening = 2.0 + len(path) / 10
            factor = 1 + softening * (np.hypot(slip, 0.001) - 0.001)  # smooth at zero
            assert factor == pytest.approx(1 + softening * slip, abs=0.001 * softening)
            softer[f"{path}.cornering_stiffness"] /= factor
            if group.relaxation_length:
                lost = group.cornering_stiffness * (1 - 1 / factor)
                softer[f"{path}.relaxation_length"] += lost * axle_compliance(group, unit.roll_axis_height)
    k = len(plain.inputs)
    narrow = np.r_[d[:k], d[len(extended.inputs) :][:k]]
    for actual, expected in zip(step(extended, x, d, values), step(plain, x, narrow, softer), strict=True):
        assert actual == pytest.approx(expected, rel=1e-10, abs=1e-13)
    assert step(plain, x, narrow, values)[0] == pytest.approx(step(extended, x, d, values)[0], rel=1e-12)
    unsoftened = all_parameters(vehicle, plain.outputs)
    assert step(plain, x, narrow, values)[0] != pytest.approx(step(plain, x, narrow, unsoftened)[0], rel=1e-4)


def sine(frequency: float = 0.3, amplitude: float = 0.03) -> Record:
    time = np.arange(0, 20, DT)
    steer = amplitude * np.sin(2 * np.pi * frequency * time)
    return Record(time=time, signals={"speed": np.full(len(time), SPEED), STEER: steer}, name="sine")


def response(chain: ChainModel, record: Record, errors: dict[str, float]) -> Array:
    """Outputs (N, m) to the inputs of a record, corrected by delay and play as an estimator does."""
    inputs = corrected_inputs(record, chain.inputs, errors)
    values = all_parameters(LOGGED, chain.outputs, extended=chain.extended) | errors | {f"{STEER}.delay": 0.0}
    return free_response(chain, values, record.time, inputs)[1]


def test_a_delay_of_a_sensor_shifts_its_output() -> None:
    """By its rate, to first order, and only its own."""
    extended, delay = model(LOGGED, SENSORS, roll=True, extended=True), 0.02
    x, d = sample(extended)
    m, values = matrices(LOGGED, SPEED, roll=True), all_parameters(LOGGED, SENSORS, extended=True)
    after = d[len(extended.inputs) :]
    rate = m.A @ x + m.B[:, 0] * after[extended.inputs.index(STEER)]
    expected = {name: x[m.states.index(name)] - delay * rate[m.states.index(name)] for name in SENSORS}
    late = step(extended, x, d, values | {f"{name}.delay": delay for name in SENSORS})[1]
    assert late == pytest.approx([expected[name] for name in SENSORS], rel=1e-6)
    only_one = step(extended, x, d, values | {f"{YAW}.delay": delay})[1]
    assert only_one == pytest.approx([expected[YAW], *step(extended, x, d, values)[1][1:]], rel=1e-6)


@pytest.mark.parametrize("extended", [False, True])
def test_misalignment_mixes_the_rates_of_a_unit(extended: bool) -> None:
    chain = model(LOGGED, SENSORS, roll=True, extended=extended)
    x, d = sample(chain)
    values = all_parameters(LOGGED, SENSORS, extended=extended)
    state = dict(zip(chain.states, x, strict=True))
    errors = {f"{YAW}.misalignment": 0.05, f"{ROLL}.misalignment": -0.1, f"{ROLL}.gain": 1.1, f"{ROLL}.offset": 0.01}
    actual = dict(zip(SENSORS, step(chain, x, d, values | errors)[1], strict=True))
    assert actual[YAW] == pytest.approx(state[YAW] + 0.05 * state["roll_rate.tractor"], rel=1e-12)
    assert actual[ROLL] == pytest.approx(1.1 * (state[ROLL] - 0.1 * state["yaw_rate.semitrailer"]) + 0.01, rel=1e-12)
    for name in set(SENSORS) - {YAW, ROLL}:
        assert actual[name] == pytest.approx(state[name], rel=1e-12)


def test_play_with_its_contact_as_input_is_that_of_corrected_inputs() -> None:
    plain, extended = both(LOGGED, SENSORS)
    errors = {f"{STEER}.play": 0.008, f"{STEER}.gain": 1.3, f"{STEER}.delay": 0.06}
    record = sine()
    expected, actual = response(plain, record, errors), response(extended, record, errors)
    assert actual == pytest.approx(expected, abs=1e-9 * np.ptp(expected))
    without = response(plain, record, errors | {f"{STEER}.play": 0.0})
    assert np.abs(actual - without).max() > 0.05 * np.ptp(expected[:, 0])


def test_a_remaining_delay_of_the_steering_is_corrected_by_its_rate() -> None:
    """The delay of the model and the shift of the inputs have the same effect, also with play."""
    extended = model(LOGGED, SENSORS, roll=True, extended=True)
    record, delay = sine(), 0.01
    errors = {f"{STEER}.play": 0.008, f"{STEER}.gain": 1.3}
    shifted = response(extended, record, errors | {f"{STEER}.delay": delay})
    inputs = corrected_inputs(record, extended.inputs, errors)
    values = all_parameters(LOGGED, SENSORS, extended=True) | errors | {f"{STEER}.delay": delay}
    by_rate = free_response(extended, values, record.time, inputs)[1]
    on_time = response(extended, record, errors)
    settled = record.time > 2  # before that the contact of the play is unknown
    effect = np.abs(shifted - on_time)[settled].max(axis=0)
    assert (np.abs(by_rate - shifted)[settled].max(axis=0) < 0.05 * effect).all()


def test_the_time_base_scales_every_step() -> None:
    plain, extended = both(LOGGED, SENSORS)
    x, d = sample(extended)
    k, m = len(plain.inputs), len(extended.inputs)
    values = all_parameters(LOGGED, SENSORS, extended=True)
    actual = step(extended, x, d, values | {TIME_SCALE: 1.03})
    expected = step(plain, x, np.r_[d[:k], d[m : m + k]], values, 1.03 * DT)
    for one, other in zip(actual, expected, strict=True):
        assert one == pytest.approx(other, rel=1e-12, abs=1e-14)
