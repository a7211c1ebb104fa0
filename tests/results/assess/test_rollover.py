"""The rollover threshold against a rigid body, the linear model, and the balance of all moments."""

import pytest

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.model.dynamics import linear_system
from fifthwheel.results.assess.rollover import Rollover, _moments, measure, measure_effective_track, rollover
from fifthwheel.results.assess.truck import Body, Truck
from fifthwheel.truck import get, laden
from tests.results.assess.trucks import double, rigid, single_axles

TRUCK = get("cheng_cebon_2011")
TRUCK_ON_SPRINGS = Truck(vehicle=TRUCK)


def test_a_rigid_truck_rolls_over_at_half_the_track_over_the_height():
    vehicle = rigid()
    height = vehicle.units[0].sprung.cog_height
    (result,) = rollover(Truck(vehicle=vehicle, body=Body(half_track=0.9)))
    assert result.threshold == pytest.approx(0.9 / height, rel=1e-6)


def test_the_stability_factor_is_the_threshold_of_a_truck_without_springs():
    """Half the track over the CoG height of all masses, and above the threshold with springs."""
    truck = Truck(vehicle=TRUCK, body=Body(half_track=0.9))
    tractor, trailer = TRUCK.units
    load = trailer.payload
    parts = [(unit.sprung.mass, unit.sprung.cog_height) for unit in TRUCK.units]
    parts += [(load.mass, load.floor_height + load.height / 2)]
    parts += [(tractor.mass - tractor.sprung.mass, tractor.roll_axis_height)]
    parts += [(trailer.mass - trailer.sprung.mass - load.mass, trailer.roll_axis_height)]
    factor = measure_effective_track(truck)["static_stability_factor"]
    assert factor == pytest.approx(0.9 * sum(m for m, _ in parts) / sum(m * h for m, h in parts))
    assert factor > measure(truck)["rollover_threshold"]


def test_tyres_that_yield_sideways_reduce_the_track_of_a_rigid_truck():
    """All side force on the outer tyres: N a h / g = N (t - 2 N a / (g k)) with k = C / sigma of each group."""
    fields = rigid().model_dump()
    for group in fields["units"][0]["axle_groups"]:
        group |= {"relaxation_length": 0.4, "cornering_stiffness": 5e5}
    truck = Truck(vehicle=type(TRUCK)(**fields), body=Body(half_track=0.9))
    height, loads = truck.vehicle.units[0].sprung.cog_height, truck.vehicle.axle_loads()
    weight = sum(loads.values())
    shift = sum(load**2 for load in loads.values()) / weight * 2 * 0.4 / 5e5  # both axles lift at once on a rigid body
    (result,) = rollover(truck, effective_track=True)
    assert result.threshold == pytest.approx(0.9 / (height + shift), rel=1e-5)
    assert result.threshold < 0.97 * rollover(truck)[0].threshold
    stiff = Truck(vehicle=single_axles())  # without relaxation lengths
    assert rollover(stiff, effective_track=True)[0].threshold == rollover(stiff)[0].threshold


def test_load_transfer_before_the_first_lift_is_that_of_the_linear_model():
    """In a steady turn at high speed, so that the side forces of its axles follow their loads."""
    vehicle, speed = single_axles(), 30.0
    truck = Truck(vehicle=vehicle)
    (result,) = rollover(truck)
    paths = [path for *_, path in truck.groups()]
    system = linear_system(vehicle, speed, [f"load_transfer_moment.{path}" for path in paths] + ["yaw_rate.tractor"])
    *moments, yaw_rate = system.gain()[:, 0]
    loads = vehicle.axle_loads()
    for path, moment in zip(paths, moments, strict=True):
        at_lift = loads[path] * truck.body.half_track / abs(moment / (speed * yaw_rate)) / GRAVITY
        if path == min(result.lifts, key=lambda p: result.lifts[p]):
            assert result.lifts[path] == pytest.approx(at_lift, rel=0.01)
        else:
            assert at_lift > min(result.lifts.values())


@pytest.mark.parametrize("vehicle", [get("auburn_6x4"), double()], ids=["one trailer", "two trailers"])
def test_moments_about_the_ground_balance_at_the_threshold(vehicle):
    """All inner wheels but those of groups that never lift are off the ground."""
    truck = Truck(vehicle=vehicle)
    (result,) = rollover(truck)
    overturning, restoring = moments_about_the_ground(truck, result)
    assert restoring == pytest.approx(overturning, rel=1e-9)


def moments_about_the_ground(truck: Truck, result: Rollover) -> tuple[float, float]:
    """Overturning and restoring moment at the threshold, N m."""
    p, loads = truck.vehicle.parameters(), truck.vehicle.axle_loads()
    overturning, restoring = 0.0, 0.0
    for _, unit, group, path in truck.groups():
        phi = result.roll[unit.name][1][-1]
        moment = group.total_roll_stiffness * phi + unit.roll_axis_height * loads[path] * result.threshold
        lifted = path in result.lifts
        restoring += loads[path] * truck.body.half_track if lifted else moment
    for unit in truck.vehicle.units:
        body, phi = laden(p, unit), result.roll[unit.name][1][-1]
        lever = body.cog_height - unit.roll_axis_height
        overturning += GRAVITY * body.mass * lever * (result.threshold + phi)
        overturning += GRAVITY * unit.mass * unit.roll_axis_height * result.threshold
    return overturning, restoring


def test_a_decoupled_trailer_has_its_own_threshold():
    coupled = Truck(vehicle=TRUCK)
    decoupled = coupled.changed({"fifth_wheel.roll_stiffness": 0.0})
    tractor, trailer = rollover(decoupled)
    assert tractor.threshold > rollover(coupled)[0].threshold > trailer.threshold
    assert measure(decoupled)["rollover_threshold"] == trailer.threshold


def test_a_truck_that_cannot_stand_is_refused():
    soft = {f"tractor.{group}.roll_stiffness": 1e3 for group in ("front", "drive")}
    truck = Truck(vehicle=TRUCK).changed({**soft, "semitrailer.roll_stiffness": 1e3})
    with pytest.raises(VehicleError, match="raise roll_stiffness"):
        rollover(truck)


def test_a_truck_that_no_acceleration_rolls_over_is_refused(monkeypatch):
    """A moment about the roll axes towards the inside of the turn lifts no inner wheel."""
    weight, moment = _moments(TRUCK_ON_SPRINGS, [0, 1])
    monkeypatch.setattr("fifthwheel.results.assess.rollover._moments", lambda *_: (weight, -3 * moment))
    with pytest.raises(VehicleError, match="tractor, semitrailer: no acceleration lifts its inner wheels"):
        rollover(TRUCK_ON_SPRINGS)
