"""The yaw moment of a coupling against two rigid bodies in the plane, by Newton and Euler, with their force."""

import numpy as np
import pytest
from scipy.linalg import expm

from fifthwheel.model.dynamics import linear_system, matrices
from fifthwheel.truck import Vehicle, get

SPEED = 13.0
K, C = 4e4, 6e4
NO_LAG = {f"{path}.relaxation_length": 0.0 for path in get("articulated_bus").group_paths()}
FREE = get("articulated_bus").replace(NO_LAG | {"joint.yaw_damping": 0.0})
BUS = FREE.replace({"joint.yaw_stiffness": K, "joint.yaw_damping": C})


def newton_euler(vehicle: Vehicle, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """A and B of x' = A x + B steer, x = (v_1, r_1, r_2, articulation).

    The unknowns are v_1', r_1', v_2', r_2' and the side force Y of the coupling on the unit in front. The moment
    k g + c g' of the articulation g turns the unit in front, and the unit behind the other way.
    """
    (front, rear), (coupling,) = vehicle.units, vehicle.couplings
    k, c = coupling.yaw_stiffness or 0.0, coupling.yaw_damping or 0.0
    a, b = coupling.leading_position - front.cog, coupling.trailing_position - rear.cog
    A, B = np.zeros((4, 4)), np.zeros((4, 1))
    for column in range(5):
        *x, steer = np.eye(5)[column]
        v1, r1, r2, angle = x
        v2 = v1 + a * r1 - speed * angle - b * r2
        force, moment = np.zeros(2), np.zeros(2)
        for i, (unit, v, r) in enumerate(((front, v1, r1), (rear, v2, r2))):
            for group in unit.axle_groups:
                arm = group.axles[0].position - unit.cog
                side = group.cornering_stiffness * (steer * group.axles[0].steerable - (v + arm * r) / speed)
                force[i] += side
                moment[i] += arm * side
        twist = k * angle + c * (r2 - r1)
        m1, m2, i1, i2 = front.mass, rear.mass, front.yaw_inertia, rear.yaw_inertia
        left = np.array(
            [
                [m1, 0, 0, 0, -1],
                [0, i1, 0, 0, -a],
                [0, 0, m2, 0, 1],
                [0, 0, 0, i2, b],
                [1, a, -1, -b, 0],  # the coupling has one acceleration
            ]
        )
        right = [
            force[0] - m1 * speed * r1,
            moment[0] + twist,
            force[1] - m2 * speed * r2,
            moment[1] - twist,
            speed * (r2 - r1),
        ]
        dv1, dr1, _, dr2, _ = np.linalg.solve(left, right)
        (B if column == 4 else A)[:, 0 if column == 4 else column] = dv1, dr1, dr2, r2 - r1
    return A, B


@pytest.mark.parametrize("vehicle", [FREE, BUS], ids=["free", "with a moment"])
def test_equals_two_bodies(vehicle: Vehicle) -> None:
    m = matrices(vehicle, SPEED, roll=False)
    assert [name.partition(".")[0] for name in m.states] == ["lateral_velocity", "yaw_rate", "yaw_rate", "articulation"]
    A, B = newton_euler(vehicle, SPEED)
    assert np.allclose(m.A, A, rtol=1e-9, atol=1e-9)
    assert np.allclose(m.B, B, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("roll", [False, True])
def test_moments_of_a_steady_turn_balance(roll: bool) -> None:
    """About the coupling, the side force of the rear axle balances the inertia force and the spring, not the damper."""
    outputs = ["lateral_velocity.rear", "yaw_rate.rear", "articulation.rear"]
    v, r, angle = linear_system(BUS, SPEED, outputs, roll=roll).gain()[:, 0]
    rear, axle = BUS.units[1], BUS.units[1].axles[0].position
    side = -rear.axle_groups[0].cornering_stiffness * (v + (axle - rear.cog) * r) / SPEED
    spring = K * angle
    assert abs(spring) > 0.01 * abs(axle * side)
    assert axle * side - spring == pytest.approx(rear.mass * SPEED * r * rear.cog, rel=1e-9)


def test_damper_dissipates_the_energy_that_is_lost() -> None:
    """Kinetic energy and that of the spring change by the work of the tyres, less that of the damper."""
    m, dt = matrices(BUS, SPEED, roll=False), 5e-4
    with_heading = np.zeros((5, 5))
    with_heading[:4, :4], with_heading[4, 1] = m.A, 1.0
    x, step = np.array([0.3, 0.1, -0.2, 0.15, 0.05]), expm(with_heading * dt)
    states = np.array([x := step @ x for _ in range(4000)])
    v1, r1, r2, angle, heading = states.T
    (front, rear), (coupling,) = BUS.units, BUS.couplings
    v2 = (
        v1 + (coupling.leading_position - front.cog) * r1 - SPEED * angle - (coupling.trailing_position - rear.cog) * r2
    )
    # across the direction in which the bus drove, where no inertia force of the rotating axes does work
    across = (v1 + SPEED * heading, r1, front), (v2 + SPEED * (heading + angle), r2, rear)
    energy, power = K * angle**2 / 2, -C * (r2 - r1) ** 2
    for (speed, r, unit), v in zip(across, (v1, v2), strict=True):
        energy = energy + unit.mass * speed**2 / 2 + unit.yaw_inertia * r**2 / 2
        for group in unit.axle_groups:
            arm = group.axles[0].position - unit.cog
            power = power - group.cornering_stiffness * (v + arm * r) / SPEED * (speed + arm * r)
    assert np.trapezoid(C * (r2 - r1) ** 2, dx=dt) > 0.1 * np.ptp(energy)
    assert energy[-1] - energy[0] == pytest.approx(np.trapezoid(power, dx=dt), rel=1e-5)
