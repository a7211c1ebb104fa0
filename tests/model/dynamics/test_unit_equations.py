"""A damper in series with the tyres, and models of vehicles with relaxation lengths."""

import numpy as np
import pytest

from fifthwheel.model.dynamics import all_parameters, matrices, model
from fifthwheel.truck import Axle, AxleGroup, SprungMass, Unit, Vehicle
from tests.model.dynamics.lagrangian import GRAVITY
from tests.model.dynamics.test_lagrangian import TRUCK, with_relaxation

FREQUENCY = np.array([0.3, 1.0, 4.0, 12.0])  # Hz


def group(name: str, *axles: Axle, sigma: float = 0.0) -> AxleGroup:
    rolling = {"roll_stiffness": 9e5, "tyre_roll_stiffness": 3e6, "roll_damping": 2e4}
    return AxleGroup(name=name, axles=axles, cornering_stiffness=4e5, relaxation_length=sigma, **rolling)


def truck(*groups: AxleGroup) -> Vehicle:
    sprung = SprungMass(mass=12000, cog_height=1.5, roll_inertia=8000)
    numbers = {"mass": 14000, "cog": -4.0, "yaw_inertia": 6e4, "roll_axis_height": 0.6}
    return Vehicle(name="truck", units=(Unit(name="truck", **numbers, sprung=sprung, axle_groups=groups),))


def test_vehicles_share_a_model_if_the_same_groups_have_a_relaxation_length() -> None:
    none, every, some = (with_relaxation(TRUCK, *lengths) for lengths in ((0.0,), (0.4,), (0.4, 0.0, 0.4)))
    assert model(every, (), roll=True) is model(with_relaxation(TRUCK, 0.7), (), roll=True)
    assert len({id(model(vehicle, (), roll=True)) for vehicle in (none, every, some)}) == 3
    assert [len(model(vehicle, (), roll=False).states) for vehicle in (none, every, some)] == [4, 7, 6]
    assert "tractor.front.relaxation_length" in all_parameters(none, ())


def roll_terms(vehicle: Vehicle) -> tuple[float, float]:
    """Roll stiffness and roll damping of the library's body, without gravity, N m/rad and N m s/rad."""
    m = matrices(vehicle, 20.0, roll=True)
    unit = vehicle.units[0]
    row, columns = m.states.index("roll_rate.truck"), [m.states.index(f"{q}.truck") for q in ("roll", "roll_rate")]
    gravity = unit.sprung.mass * (unit.sprung.cog_height - unit.roll_axis_height) * GRAVITY
    return gravity - m.F[row, columns[0]], -m.F[row, columns[1]]


def sprung_on_tyres(*suspensions: tuple[float, float, float]) -> Vehicle:
    """A truck with one suspension (K, C, K_t) for each axle."""
    groups = (
        group(f"axle{i}", Axle(name=f"axle{i}", position=-5.0 * i, steerable=not i)).model_copy(
            update={"roll_stiffness": K, "roll_damping": C, "tyre_roll_stiffness": tyres}
        )
        for i, (K, C, tyres) in enumerate(suspensions)
    )
    return truck(*groups)


SUSPENSIONS = ((9e5, 2e4, 1.6e6), (2.7e6, 1.2e5, 5.7e6))


def test_damper_in_series_with_the_tyres() -> None:
    """A massless axle between spring and damper, K + i w C, and tyres, K_t: the complex stiffness of the series is
    K* + i w C* at low frequency; the remainder is of order w^2 in its real and w^3 in its imaginary part."""
    stiffness, damping = roll_terms(sprung_on_tyres(*SUSPENSIONS))

    def remainder(w: float) -> complex:
        exact = sum(1 / (1 / (K + 1j * w * C) + 1 / tyres) for K, C, tyres in SUSPENSIONS)
        return exact - stiffness - 1j * w * damping

    coarse, fine = remainder(0.2), remainder(0.1)
    assert abs(fine) < 1e-5 * stiffness
    assert coarse.real / fine.real == pytest.approx(4, rel=1e-3)
    assert coarse.imag / fine.imag == pytest.approx(8, rel=1e-3)
    total = sum(C for _, C, _ in SUSPENSIONS)
    assert damping < 0.5 * total  # the article's (A3) has the total
