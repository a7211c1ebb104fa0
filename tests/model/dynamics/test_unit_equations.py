"""Forces on a unit: side forces with a relaxation length, and a damper in series with the tyres."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fifthwheel.model.dynamics import all_parameters, frequency_response, matrices, model, steady_state
from fifthwheel.model.dynamics.unit_equations import relaxation_length
from fifthwheel.truck import Axle, AxleGroup, SprungMass, Unit, Vehicle
from tests.model.dynamics.lagrangian import GRAVITY
from tests.model.dynamics.test_lagrangian import TRUCK, with_relaxation

OF_TYRES, SPEED = 0.6, 17.0
SIGMA = OF_TYRES + 4e5 * (0.6 * 1.3) ** 2 / 3.9e6
"""m: the roll centre of the suspension is 0.6 (1 + 9e5 / 3e6) m above the road, and an axle rolls by its height times
the side force over 9e5 + 3e6 N m/rad."""
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


class FrequencyResponse:
    """Response of a truck to one steered axle; its front group has a relaxation length, its rear axle at -9 m none."""

    def __init__(self, steered: int, *positions: float) -> None:
        axles = [Axle(name=f"at{i}", position=x, steerable=i == steered) for i, x in enumerate(positions)]
        vehicle = truck(group("front", *axles, sigma=OF_TYRES), group("rear", Axle(name="rear", position=-9.0)))
        m = matrices(vehicle, SPEED, roll=False)
        x = frequency_response(vehicle, SPEED, FREQUENCY, roll=False)[:, :, 0]
        v, r, self.lagged = x.T
        assert m.states == ("lateral_velocity.truck", "yaw_rate.truck", "slip_angle.truck.front")
        self.arms = np.array(positions) + 4.0
        self.slip = (np.arange(len(positions)) == steered)[:, None] - (v + self.arms[:, None] * r) / SPEED
        rear = -4e5 * (v - 5.0 * r) / SPEED
        self.force = 14000 * (S * v + SPEED * r) - rear  # force of the front group by Newton's law
        self.moment = 6e4 * S * r + 5.0 * rear


LAG = 1 / (1 + S * SIGMA / SPEED)


def test_side_force_of_a_single_axle_is_a_first_order_lag() -> None:
    """1 / (1 + s sigma / u), with the corner at u / (2 pi sigma) Hz."""
    assert abs(LAG[2]) == pytest.approx(np.sqrt(0.5))
    actual = FrequencyResponse(0, -0.5)
    assert actual.lagged == pytest.approx(LAG * actual.slip[0], rel=1e-9)
    assert actual.force == pytest.approx(4e5 * LAG * actual.slip[0], rel=1e-9)
    assert actual.moment == pytest.approx(3.5 * 4e5 * LAG * actual.slip[0], rel=1e-9)


@pytest.mark.parametrize("steered", [0, 1])
def test_differences_of_slip_angles_within_a_group_act_without_lag(steered: int) -> None:
    """The total force of two axles lags their mean slip angle; the couple of the two forces does not lag."""
    actual = FrequencyResponse(steered, -1.0, -2.2)
    mean = actual.slip.mean(axis=0)
    assert np.abs(actual.slip[0] - actual.slip[1]).min() > 0.5
    assert actual.lagged == pytest.approx(LAG * mean, rel=1e-9)
    assert actual.force == pytest.approx(4e5 * LAG * mean, rel=1e-9)
    couple = 2e5 * (actual.arms[0] - actual.arms[1]) * (actual.slip[0] - actual.slip[1]) / 2
    assert actual.moment == pytest.approx(actual.force * actual.arms.mean() + couple, rel=1e-9)


@pytest.mark.parametrize("roll", [True, False], ids=["yaw-roll", "yaw only"])
def test_a_relaxation_length_has_no_effect_in_a_steady_turn(roll: bool) -> None:
    steer = np.linspace(0.02, -0.01, len(TRUCK.steer_signals()))
    without, actual = (steady_state(with_relaxation(TRUCK, length), 15.0, steer, roll=roll) for length in (0.0, 0.8))
    assert {name: actual[name] for name in without} == pytest.approx(without, rel=1e-9, abs=1e-12)
    assert {name.partition(".")[0] for name in set(actual) - set(without)} == {"slip_angle"}


@pytest.mark.parametrize(("length", "tyres"), [(1e-6, 1.6e6), (0.45, 3e6)])
def test_an_axle_that_rolls_on_its_tyres_delays_its_side_force(length: float, tyres: float) -> None:
    """Two springs in series under a body that does not move, after a step of the slip angle.

    The carcass deflects by e, the axle rolls by theta about the road contact, which its roll centre at the height h
    keeps under the body. Both move the contact sideways: the tread has the slip angle alpha - (e + h theta)' / u and
    the side force C times that, which loads both springs. The body rolls about the point that does not move sideways.
    """
    C, K, axis = 4e5, 9e5, 0.6

    def sideways(height: float) -> float:
        """Displacement at the height `axis` of a body that rolls by 1 rad on its springs, without side force, m."""
        theta = K / (K + tyres)
        return height * theta - (height - axis)

    low, high = sideways(0.0), sideways(1.0)
    h = low / (low - high)  # the displacement is linear in the height of the roll centre
    carcass, alpha = C / length, 0.01  # N/m, rad

    def rate(_: float, contact: np.ndarray) -> list[float]:
        """Speed of the contact across the body, m/s: balance of the carcass and of the moments on the axle."""
        springs = [[carcass, 0.0, -1.0], [0.0, K + tyres, -h], [1.0, h, 0.0]]  # e, theta, F; their sum is the contact
        force = np.linalg.solve(springs, [0.0, 0.0, contact[0]])[2]
        return [SPEED * (alpha - force / C)]

    vehicle = truck(
        group("front", Axle(name="front", position=0.0, steerable=True), sigma=length).model_copy(
            update={"tyre_roll_stiffness": tyres}
        ),
        group("rear", Axle(name="rear", position=-6.0)),
    )
    sigma = float(relaxation_length(vehicle.parameters(), vehicle.units[0], "truck.front"))
    time = np.linspace(0, 5 * sigma / SPEED, 50)
    solution = solve_ivp(rate, (0, time[-1]), [0.0], t_eval=time, rtol=1e-9, atol=1e-14, method="LSODA")
    slip = np.array([alpha - rate(0.0, contact)[0] / SPEED for contact in solution.y.T])  # F / C
    np.testing.assert_allclose(slip, alpha * (1 - np.exp(-SPEED * time / sigma)), atol=1e-6 * alpha)
    m = matrices(vehicle, SPEED, roll=True)
    i = m.states.index("slip_angle.truck.front")
    assert m.A[i, i] == pytest.approx(-SPEED / sigma, rel=1e-12)
    assert m.B[i, 0] == pytest.approx(SPEED / sigma, rel=1e-12)


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
