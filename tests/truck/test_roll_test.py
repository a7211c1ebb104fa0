"""Roll stiffness and roll axis from a static test, against the equilibrium of all units."""

import math

import numpy as np
import pytest

from fifthwheel.apps.workflow.measured_vehicle import roll_tested_vehicle
from fifthwheel.base.errors import VehicleError
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.truck import Measured, RollTest, Vehicle, catalogue, with_roll_test
from tests.truck.test_vehicle import b_double

TRUCK = catalogue.get("cheng_cebon_2011")
STIFFNESS, AXIS = "semitrailer.roll_stiffness", "semitrailer.roll_axis_height"
LOAD, SHIFT, PLACE = 2000.0, 0.9, 0.95


def rolls(vehicle: Vehicle, moments: list[float]) -> np.ndarray:
    """Roll angles of all units under roll moments, N m: the equilibrium of springs and gravity."""
    p, derived, n = vehicle.parameters(), vehicle.derived(), len(vehicle.units)
    S = np.zeros((n, n))
    for i, unit in enumerate(vehicle.units):
        for group in unit.axle_groups:
            S[i, i] += 1 / (1 / group.roll_stiffness + 1 / group.tyre_roll_stiffness)
        height = derived[f"{unit.name}.cog_height"] - p[f"{unit.name}.roll_axis_height"]
        S[i, i] -= unit.laden_sprung_mass * STANDARD_GRAVITY * height
    for i, coupling in enumerate(vehicle.couplings):
        S[i : i + 2, i : i + 2] += coupling.roll_stiffness * np.array([[1, -1], [-1, 1]])
    return np.linalg.solve(S, moments)


def readings(vehicle: Vehicle, unit: int = 1, relative: float = 0.0) -> RollTest:
    """Exact readings of a vehicle, each with the same relative standard deviation."""
    moments = [0.0] * len(vehicle.units)
    moments[unit] = LOAD * STANDARD_GRAVITY * SHIFT
    roll = float(rolls(vehicle, moments)[unit])
    y = roll * (PLACE - vehicle.units[unit].roll_axis_height)
    values = (Measured(v, relative * v) for v in (LOAD, SHIFT, roll, y, PLACE))
    return RollTest(vehicle.units[unit].name, *values)


def test_the_true_stiffness_and_axis_are_found() -> None:
    p = TRUCK.parameters()
    assumed = TRUCK.replace({STIFFNESS: 1.3 * p[STIFFNESS], AXIS: p[AXIS] - 0.1})
    found = with_roll_test(TRUCK.replace({STIFFNESS: 1.3 * p[STIFFNESS]}), readings(TRUCK), {})
    assert found.parameters() == pytest.approx(p, rel=1e-9)
    assert found.stated == {STIFFNESS: 0.0, AXIS: 0.0, "semitrailer.tyre_roll_stiffness": 0.0}
    assert with_roll_test(assumed, readings(TRUCK), {}).parameters()[AXIS] == pytest.approx(p[AXIS])
    train = b_double()
    path = train.units[1].group_path(train.units[1].axle_groups[0]) + ".roll_stiffness"
    found = with_roll_test(train.replace({path: 2 * train.parameters()[path]}), readings(train), {})
    assert found.parameters() == pytest.approx(train.parameters(), rel=1e-9)  # of a unit between two others


def test_sigma_against_random_readings_and_numbers() -> None:
    """The scatter of the result over random errors of the readings and of the file is the stated sigma."""
    sigmas = {"fifth_wheel.roll_stiffness": 3e5, "tractor.drive.roll_stiffness": 4e4, "semitrailer.sprung.mass": 300.0}
    p, test, rng = TRUCK.parameters(), readings(TRUCK, relative=0.02), np.random.default_rng(1)
    stated = with_roll_test(TRUCK, test, sigmas).stated
    results = []
    for _ in range(300):
        file = TRUCK.replace({path: p[path] + s * rng.normal() for path, s in sigmas.items()})
        drawn = [m._replace(value=m.value + m.sigma * rng.normal()) for m in test[1:]]
        found = with_roll_test(file, RollTest(test.unit, *drawn), {}).parameters()
        results.append([found[STIFFNESS], found[AXIS]])
    assert np.std(results, axis=0) == pytest.approx([stated[STIFFNESS], stated[AXIS]], rel=0.1)


def test_other_numbers_have_the_uncertainty_that_an_identification_assumes() -> None:
    tested = roll_tested_vehicle(TRUCK, readings(TRUCK, relative=0.01))
    exact = roll_tested_vehicle(
        TRUCK.with_stated(dict.fromkeys(TRUCK.parameters(), 0.0)), readings(TRUCK, relative=0.01)
    )
    assert tested.stated[STIFFNESS] > 1.5 * exact.stated[STIFFNESS]
    assert tested.stated[STIFFNESS] < 0.1 * TRUCK.parameters()[STIFFNESS]
    assert tested.source.endswith("; roll test of the semitrailer")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"unit": "tractor"}, "tractor: expected one axle group, got 2"),
        ({"unit": "dolly"}, "dolly: no such unit"),
        ({"roll": Measured(-0.01, 0.0)}, "roll: expected above 0"),
        ({"roll": Measured(math.radians(6), 0.0)}, r"roll: expected at most 5 deg, got 6\.0 deg"),
        ({"roll": Measured(1e-4, 0.0)}, "expected suspension and tyres together between 0 and"),
        ({"height": None}, "displacement: expected with height"),
    ],
)
def test_readings_that_are_not_plausible(changes: dict, message: str) -> None:
    with pytest.raises(VehicleError, match=message):
        with_roll_test(TRUCK, readings(TRUCK)._replace(**changes), {})
