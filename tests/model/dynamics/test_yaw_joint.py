"""The yaw moment of a coupling against two rigid bodies in the plane, by Newton and Euler, with their force."""

import numpy as np
import pytest

from fifthwheel.model.dynamics import matrices
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
