"""The accelerometer against finite differences of a simulated run; wheel speed differences of axles and model."""

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.base.types import Array
from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.data.record import Record
from fifthwheel.estimate.filters.step_rows import corrected_inputs
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.sensors import wheel_pairs, with_wheel_speed_differences
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.model.dynamics.unit_equations import BANK
from fifthwheel.truck import Vehicle, get
from fifthwheel.truck.unit import Accelerometer

SPEED, RATE = 22.0, 1000.0
STEER = "steer.tractor.front"
TRUCK = get("cheng_cebon_2011").with_logged_steering({STEER}, "the test")


def placed(truck: Vehicle, position: float, height: float) -> Vehicle:
    """The truck with an accelerometer on every unit."""
    place = Accelerometer(position=position, height=height)
    units = [unit.model_copy(update={"accelerometer": place}) for unit in truck.units]
    return truck.model_copy(update={"units": tuple(units)})


def run(truck: Vehicle, outputs: tuple[str, ...], *, extended: bool = False, **errors: float) -> dict[str, Array]:
    """Outputs of a lane change on a road with a bank of 0.02 rad; keys of `errors` have "_" for "."."""
    time = np.arange(round(4 * RATE)) / RATE
    steer = 0.01 * np.sin(2.4 * time) * np.sin(0.7 * time)
    record = Record(time=time, signals={"speed": np.full_like(time, SPEED), STEER: steer})
    model = dynamics.model(truck, outputs, roll=True, bank=True, extended=extended)
    values = dynamics.all_parameters(truck, outputs, extended=extended)
    for sensor in outputs:
        values |= {f"{sensor}.{kind}": value for kind, value in errors.items() if f"{sensor}.{kind}" in values}
    start = np.zeros(len(model.states))
    start[model.states.index(BANK)] = 0.02
    _, y = free_response(model, values, time, corrected_inputs(record, model.inputs, values), start)
    return dict(zip(outputs, y.T, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize(("unit", "position", "height"), [("tractor", 0.0, 0.4), ("semitrailer", -4.1, 2.3)])
def test_output_is_acceleration_and_gravity_at_its_place(unit: str, position: float, height: float) -> None:
    """dv/dt + u r of the sensor's place, and g times roll and bank."""
    truck = placed(TRUCK, position, height)
    quantities = ("lateral_acceleration", "lateral_velocity", "yaw_rate", "roll")
    y = run(truck, tuple(f"{quantity}.{unit}" for quantity in quantities))
    v = run(truck, (f"lateral_velocity.{unit}",), position=position, height=height)[f"lateral_velocity.{unit}"]
    expected = np.gradient(v, 1 / RATE) + SPEED * y[f"yaw_rate.{unit}"] + GRAVITY * (y[f"roll.{unit}"] + 0.02)
    actual = y[f"lateral_acceleration.{unit}"]
    np.testing.assert_allclose(actual[5:-5], expected[5:-5], atol=1e-5)


def test_default_place_is_under_the_cog_on_the_roll_axis() -> None:
    name, tractor = "lateral_acceleration.tractor", TRUCK.units[0]
    by_default = run(TRUCK, (name,))[name]
    here, ahead = (run(placed(TRUCK, tractor.cog + x, tractor.roll_axis_height), (name,))[name] for x in (0.0, 1.0))
    assert (here == by_default).all()
    assert np.abs(ahead - by_default).max() > 0.01


@pytest.mark.slow
@pytest.mark.parametrize(("unit", "relaxation"), [("semitrailer", True), ("tractor", False)])
def test_a_delay_shifts_the_output(unit: str, relaxation: bool) -> None:
    """Without relaxation, side forces follow the steer angle at once."""
    truck, name, delay = placed(TRUCK, -2.0, 1.1), f"lateral_acceleration.{unit}", 0.01
    if not relaxation:
        truck = truck.replace({path: 0.0 for path in truck.parameters() if path.endswith("relaxation_length")})
    exact, late = (run(truck, (name,), extended=True, delay=d)[name] for d in (0.0, delay))
    shifted = exact - delay * np.gradient(exact, 1 / RATE)
    np.testing.assert_allclose(late[5:-5], shifted[5:-5], atol=2e-4)
    assert np.abs(late - exact).max() > 0.01


TRAILER, FRONT = "wheel_speed_difference.semitrailer", "wheel_speed_difference.tractor.front"


def wheels(*axles: str) -> list[str]:
    return [f"wheel_speed.{axle}.{side}" for axle in axles for side in ("left", "right")]


@pytest.fixture(scope="module")
def truck() -> Vehicle:
    truck = get("cheng_cebon_2011")
    return truck.with_logged_steering({"steer.tractor.front"}, "")


def test_axles_that_are_not_driven_count_with_both_wheels_and_known_loads(truck: Vehicle) -> None:
    """The load transfer ratio needs loads; a trailer whose axles are two groups has three supports."""
    names = wheels("tractor.front", "tractor.drive", "tractor.rear", "semitrailer", "semitrailer.middle")
    assert sorted(wheel_pairs(truck, names)) == sorted([FRONT, TRAILER, f"{TRAILER}.middle"])
    assert wheel_pairs(truck, ["wheel_speed.semitrailer.left", "wheel_speed.tractor.front"]) == ()
    fields = truck.model_dump()
    (group,) = fields["units"][1]["axle_groups"]
    first, *others = group["axles"]
    fields["units"][1]["axle_groups"] = [{**group, "name": "lift", "axles": [first]}, {**group, "axles": others}]
    assert wheel_pairs(Vehicle(**fields), wheels("semitrailer")) == ()
    for name in ("rear", "rear.drive"):  # of a bus whose engine drives its last axle
        assert wheel_pairs(get("articulated_bus"), wheels(name, "front.steer")) == (
            "wheel_speed_difference.front.steer",
        )


def test_a_record_with_the_differences(truck: Vehicle) -> None:
    left, right = [20.0, np.nan, 0.2, 10.0], [20.2, 20.0, 0.2, 9.9]
    signals = dict(zip(wheels("semitrailer"), (left, right), strict=True))
    record = Record(time=[0, 1, 2, 3], signals=signals, time_bases={"wheel_speed.semitrailer.left": "trailer"})
    formed = with_wheel_speed_differences(record, truck)
    expected = [0.2 / 20.1, np.nan, np.nan, -0.1 / 9.95]
    np.testing.assert_allclose(formed.signals[TRAILER], expected, rtol=1e-12)
    assert formed.time_bases[TRAILER] == "trailer"
    assert formed.signals.keys() - record.signals.keys() == {TRAILER}
    given = record.with_signals({TRAILER: np.ones(4)})
    assert with_wheel_speed_differences(given, truck) is given


@pytest.mark.slow
def test_the_output_is_kinematic_and_follows_the_load(truck: Vehicle) -> None:
    """In a steady turn with the true yaw rate and load transfer of the same model."""
    outputs = (TRAILER, FRONT, "yaw_rate.semitrailer", "yaw_rate.tractor", "load_transfer.semitrailer")
    outputs = (*outputs, "load_transfer.tractor.front")
    model = dynamics.model(truck, outputs, roll=True, tyres="saturating")
    values = dynamics.all_parameters(truck, outputs, tyres="saturating")
    values |= {f"{TRAILER}.load_sensitivity": 0.01, f"{TRAILER}.offset": 0.003, f"{TRAILER}.gain": 1.02}
    time = np.arange(0, 20, 0.02)
    angle = np.minimum(time / 5, 1) * 0.03
    inputs = {"speed": np.full_like(time, 15.0), "steer.tractor.front": angle}
    _, y = free_response(model, values, time, {n: inputs.get(n, np.zeros_like(time)) for n in model.inputs})
    trailer, front, r2, r1, transfer, _ = y[-1]
    b = values["body.half_track"]
    assert r2 > 0.05
    assert transfer > 0.1
    # in the tractor's heading, the trailer moves at an angle to it: its own speed differs by the articulation
    assert trailer == pytest.approx(1.02 * (2 * b * r2 / 15.0 + 0.01 * transfer) + 0.003, rel=2e-3)
    assert front == pytest.approx(2 * b * r1 / 15.0 * np.cos(0.03) ** 2, rel=1e-6)


def test_driven_wheels_are_refused(truck: Vehicle) -> None:
    model = dynamics.model(truck, ("wheel_speed_difference.tractor.drive",), roll=True)
    with pytest.raises(SignalError, match=r"wheel_speed_difference.tractor.drive: .* driven wheels have slip"):
        _ = model.observation
    with pytest.raises(SignalError, match="no roll"):
        dynamics.model(truck, (TRAILER,), roll=False)
