"""Forces on a unit: side forces that build up on the way, and a damper in series with the tyres."""

import numpy as np
import pytest

from fifthwheel.dynamics import all_parameters, frequency_response, matrices, model, modes, steady_state
from fifthwheel.vehicle import Axle, AxleGroup, SprungMass, Unit, Vehicle

from .lagrangian import GRAVITY
from .test_lagrangian import TRUCK, VEHICLES, b_double, lagging

SIGMA, SPEED = 0.6, 17.0
FREQUENCY = np.array([0.3, 1.0, SPEED / SIGMA / (2 * np.pi), 12.0])  # Hz
S = 2j * np.pi * FREQUENCY


def group(name: str, *axles: Axle, sigma: float = 0.0) -> AxleGroup:
    return AxleGroup(
        name=name,
        axles=axles,
        cornering_stiffness=4e5,
        roll_stiffness=9e5,
        tyre_roll_stiffness=3e6,
        roll_damping=2e4,
        relaxation_length=sigma,
    )


def truck(*groups: AxleGroup) -> Vehicle:
    unit = Unit(
        name="truck",
        mass=14000,
        cog=-4.0,
        yaw_inertia=6e4,
        roll_axis_height=0.6,
        sprung=SprungMass(mass=12000, cog_height=1.5, roll_inertia=8000),
        axle_groups=groups,
    )
    return Vehicle(name="truck", units=(unit,))


class Swinging:
    """The answer of a truck to one steered axle: its front group has a lag, its rear axle at x = -9 m has none."""

    def __init__(self, steered: int, *places: float) -> None:
        axles = [Axle(name=f"at{i}", position=x, steerable=i == steered) for i, x in enumerate(places)]
        vehicle = truck(group("front", *axles, sigma=SIGMA), group("rear", Axle(name="rear", position=-9.0)))
        m = matrices(vehicle, SPEED, roll=False)
        x = frequency_response(vehicle, SPEED, FREQUENCY, roll=False)[:, :, 0]
        v, r, self.reached = x.T
        assert m.states == ("lateral_velocity.truck", "yaw_rate.truck", "slip_angle.truck.front")
        self.arms = np.array(places) + 4.0
        self.slip = (np.arange(len(places)) == steered)[:, None] - (v + self.arms[:, None] * r) / SPEED  # by the axle
        rear = -4e5 * (v - 5.0 * r) / SPEED
        self.force = 14000 * (S * v + SPEED * r) - rear  # Newton: what the front group must do
        self.moment = 6e4 * S * r + 5.0 * rear


LAG = 1 / (1 + S * SIGMA / SPEED)


def test_side_force_of_a_single_axle_is_a_first_order_lag() -> None:
    """1 / (1 + s sigma / u), with the corner at u / (2 pi sigma) Hz."""
    assert abs(LAG[2]) == pytest.approx(np.sqrt(0.5))
    found = Swinging(0, -0.5)
    assert found.reached == pytest.approx(LAG * found.slip[0], rel=1e-9)
    assert found.force == pytest.approx(4e5 * LAG * found.slip[0], rel=1e-9)
    assert found.moment == pytest.approx(3.5 * 4e5 * LAG * found.slip[0], rel=1e-9)


@pytest.mark.parametrize("steered", [0, 1])
def test_what_axles_differ_by_acts_at_once(steered: int) -> None:
    """The force on two axles lags behind their mean slip angle; the couple of the two does not lag."""
    found = Swinging(steered, -1.0, -2.2)
    mean = found.slip.mean(axis=0)
    assert np.abs(found.slip[0] - found.slip[1]).min() > 0.5
    assert found.reached == pytest.approx(LAG * mean, rel=1e-9)
    assert found.force == pytest.approx(4e5 * LAG * mean, rel=1e-9)
    couple = 2e5 * (found.arms[0] - found.arms[1]) * (found.slip[0] - found.slip[1]) / 2
    assert found.moment == pytest.approx(found.force * found.arms.mean() + couple, rel=1e-9)


@pytest.mark.parametrize("roll", [True, False], ids=["yaw-roll", "yaw only"])
@pytest.mark.parametrize("vehicle", [TRUCK, b_double()], ids=["truck", "b_double"])
def test_a_lag_does_not_matter_in_a_steady_turn(vehicle: Vehicle, roll: bool) -> None:
    steer = np.linspace(0.02, -0.01, len(vehicle.steer_signals()))
    without = steady_state(lagging(vehicle, 0.0), 15.0, steer, roll=roll)
    for length in (0.1, 0.8):
        found = steady_state(lagging(vehicle, length), 15.0, steer, roll=roll)
        assert {name: found[name] for name in without} == pytest.approx(without, rel=1e-9, abs=1e-12)
        slipping = {name for name in found if name.startswith("slip_angle.")}
        assert set(found) - set(without) == slipping
        assert len(slipping) == sum(len(unit.axle_groups) for unit in vehicle.units)


@pytest.mark.parametrize("roll", [True, False], ids=["yaw-roll", "yaw only"])
@pytest.mark.parametrize("name", ["truck, all changed", "b_double, all late, all changed"])
def test_a_short_lag_tends_to_none(name: str, roll: bool) -> None:
    """Answers to every steered axle up to 2 Hz: off in proportion to the length, 0.1 % of the largest at 1 mm."""
    vehicle, frequency = VEHICLES[name], np.linspace(0.05, 2.0, 20)
    without = frequency_response(lagging(vehicle, 0.0), 22.0, frequency, roll=roll)
    n = without.shape[1]
    off = []
    for length in (1e-3, 1e-4):
        found = frequency_response(lagging(vehicle, length), 22.0, frequency, roll=roll)[:, :n]
        off.append((np.abs(found - without).max(axis=0) / np.abs(without).max(axis=0)).max())
    assert off[0] < 2e-3
    assert off[1] == pytest.approx(off[0] / 10, rel=0.02)
    one, other = (modes(lagging(vehicle, length), 22.0, roll=roll) for length in (0.0, 1e-4))
    for slow, same in zip(one, other, strict=False):  # slowest first; those of the lag, at 35 kHz, come last
        assert same.eigenvalue == pytest.approx(slow.eigenvalue, rel=1e-3)


def test_one_model_needs_the_same_groups_to_lag() -> None:
    none, all_late, some = (lagging(TRUCK, *lengths) for lengths in ((0.0,), (0.4,), (0.4, 0.0, 0.4)))
    assert model(all_late, (), roll=True) is model(lagging(TRUCK, 0.7), (), roll=True)
    assert len({id(model(vehicle, (), roll=True)) for vehicle in (none, all_late, some)}) == 3
    assert [len(model(vehicle, (), roll=False).states) for vehicle in (none, all_late, some)] == [4, 7, 6]
    assert "tractor.front.relaxation_length" in all_parameters(none, ())


def roll_terms(vehicle: Vehicle) -> tuple[float, float]:
    """Stiffness and damping against which the library's body rolls, N m/rad and N m s/rad."""
    m = matrices(vehicle, 20.0, roll=True)
    unit = vehicle.units[0]
    row, at = m.states.index("roll_rate.truck"), [m.states.index(f"{word}.truck") for word in ("roll", "roll_rate")]
    leaning = unit.sprung.mass * (unit.sprung.cog_height - unit.roll_axis_height) * GRAVITY
    return leaning - m.F[row, at[0]], -m.F[row, at[1]]


def sprung_on_tyres(*suspensions: tuple[float, float, float]) -> Vehicle:
    """A truck with suspensions (K, C, K_t), one an axle."""
    groups = (
        group(f"axle{i}", Axle(name=f"axle{i}", position=-5.0 * i, steerable=not i)).model_copy(
            update={"roll_stiffness": K, "roll_damping": C, "tyre_roll_stiffness": tyres}
        )
        for i, (K, C, tyres) in enumerate(suspensions)
    )
    return truck(*groups)


SUSPENSIONS = ((9e5, 2e4, 1.6e6), (2.7e6, 1.2e5, 5.7e6))


def test_damper_in_series_with_the_tyres() -> None:
    """A massless axle between a spring with a damper, K + i w C, and its tyres, K_t: the complex stiffness of the two
    in a row has K* as its value and C* as its slope at rest; what is left goes with w^2 in phase, w^3 out of it."""
    stiffness, damping = roll_terms(sprung_on_tyres(*SUSPENSIONS))

    def left(w: float) -> complex:
        exact = sum(1 / (1 / (K + 1j * w * C) + 1 / tyres) for K, C, tyres in SUSPENSIONS)
        return exact - stiffness - 1j * w * damping

    coarse, fine = left(0.2), left(0.1)
    assert abs(fine) < 1e-5 * stiffness
    assert coarse.real / fine.real == pytest.approx(4, rel=1e-3)
    assert coarse.imag / fine.imag == pytest.approx(8, rel=1e-3)
    whole = sum(C for _, C, _ in SUSPENSIONS)
    assert damping < 0.5 * whole  # what the article's (A3) has in its place


@pytest.mark.parametrize("axle_inertia", [0.0, 300.0])
def test_roll_mode_with_the_axles_free(axle_inertia: float) -> None:
    """The body's roll with every axle free to roll on its tyres, massless or with the inertia of a real one (kg m^2):
    its decay is that of C*, not of C."""
    suspensions = tuple((K, 0.2 * C, tyres) for K, C, tyres in SUSPENSIONS)
    stiffness, damping = roll_terms(sprung_on_tyres(*suspensions))
    inertia, leaning = 8000 + 12000 * 0.9**2, 12000 * 0.9 * GRAVITY

    def body(s: complex) -> complex:
        """Its moment balance at the complex frequency s."""
        moment = inertia * s**2 - leaning
        for K, C, tyres in suspensions:
            moment += 1 / (1 / (K + s * C) + 1 / (tyres + axle_inertia * s**2))
        return moment

    start = np.roots([inertia, damping, stiffness - leaning])[0]
    s = start
    for _ in range(30):  # Newton with a complex difference
        h = 1e-6 * abs(s)
        s -= body(s) * 2 * h / (body(s + h) - body(s - h))
    assert abs(body(s)) < 1e-6 * stiffness
    assert s.imag == pytest.approx(start.imag, rel=0.01)
    assert s.real == pytest.approx(start.real, rel=0.03)
    undiminished = np.roots([inertia, sum(C for _, C, _ in suspensions), stiffness - leaning])[0]
    assert undiminished.real < 1.9 * s.real
