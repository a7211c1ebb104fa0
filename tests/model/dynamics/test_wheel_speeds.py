"""Wheel speed differences: of which axles, from which samples, and the output of the model."""

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.data.record import Record
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.sensors import wheel_pairs, with_wheel_speed_differences
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.model.dynamics.tyres import TyreLaw
from fifthwheel.truck import Vehicle, get

TRAILER, FRONT = "wheel_speed_difference.semitrailer", "wheel_speed_difference.tractor.front"


def wheels(*axles: str) -> list[str]:
    return [f"wheel_speed.{axle}.{side}" for axle in axles for side in ("left", "right")]


@pytest.fixture(scope="module")
def truck() -> Vehicle:
    truck = get("cheng_cebon_2011")
    return truck.with_logged_steering({"steer.tractor.front"}, "")


def test_axles_that_are_not_driven_count(truck: Vehicle) -> None:
    names = wheels("tractor.front", "tractor.drive", "tractor.rear", "semitrailer", "semitrailer.middle")
    assert sorted(wheel_pairs(truck, names)) == sorted([FRONT, TRAILER, f"{TRAILER}.middle"])


def test_both_sides_are_needed(truck: Vehicle) -> None:
    assert wheel_pairs(truck, ["wheel_speed.semitrailer.left", "wheel_speed.tractor.front"]) == ()


def test_axle_loads_that_are_not_determined_exclude_all(truck: Vehicle) -> None:
    """The load transfer ratio needs them; a trailer whose axles are two groups has three supports."""
    fields = truck.model_dump()
    (group,) = fields["units"][1]["axle_groups"]
    first, *others = group["axles"]
    fields["units"][1]["axle_groups"] = [{**group, "name": "lift", "axles": [first]}, {**group, "axles": others}]
    assert wheel_pairs(truck, wheels("semitrailer"))
    assert wheel_pairs(Vehicle(**fields), wheels("semitrailer")) == ()


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


@pytest.mark.parametrize("tyres", ["linear", "saturating"])
def test_the_output_is_kinematic_and_follows_the_load(truck: Vehicle, tyres: TyreLaw) -> None:
    """In a steady turn with the true yaw rate and load transfer of the same model."""
    outputs = (TRAILER, FRONT, "yaw_rate.semitrailer", "yaw_rate.tractor", "load_transfer.semitrailer")
    outputs = (*outputs, "load_transfer.tractor.front")
    model = dynamics.model(truck, outputs, roll=True, tyres=tyres)
    values = dynamics.all_parameters(truck, outputs, tyres=tyres)
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
