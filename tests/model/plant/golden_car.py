"""The international roughness index of a profile, by the quarter car of ASTM E1926 at 80 km/h."""

import numpy as np
from scipy.signal import cont2discrete, lfilter, ss2tf

SPEED = 80 / 3.6
TYRE, SPRING, DAMPER, UNSPRUNG = 653.0, 63.3, 6.0, 0.15
"""1/s^2, 1/s^2, 1/s and 1, each divided by the sprung mass."""
FOOTPRINT = 0.25
"""Length over which the profile is averaged, m."""
A = np.array(
    [
        [0.0, 1.0, 0.0, 0.0],
        [-SPRING, -DAMPER, SPRING, DAMPER],
        [0.0, 0.0, 0.0, 1.0],
        [SPRING / UNSPRUNG, DAMPER / UNSPRUNG, -(TYRE + SPRING) / UNSPRUNG, -DAMPER / UNSPRUNG],
    ]
)
B = np.array([[0.0], [0.0], [0.0], [TYRE / UNSPRUNG]])
C, D = np.array([[0.0, 1.0, 0.0, -1.0]]), np.zeros((1, 1))  # the rate of the suspension


def roughness_index(height: np.ndarray, step: float) -> float:
    """The index, m/km, of heights, (N,), m, at every step, m."""
    length = round(FOOTPRINT / step)
    smooth = lfilter(np.ones(length) / length, 1.0, height)
    a, b, c, d, _ = cont2discrete((A, B, C, D), step / SPEED, method="foh")
    numerator, denominator = ss2tf(a, b, c, d)
    rate = lfilter(numerator[0], denominator, smooth - smooth[0])
    return float(1e3 * np.abs(rate).mean() / SPEED)


def gain(n: np.ndarray) -> np.ndarray:
    """Rate of the suspension per speed and height, 1/m, at spatial frequencies n, (N,), 1/m."""
    response = [np.linalg.solve(2j * np.pi * SPEED * k * np.eye(4) - A, B[:, 0])[[1, 3]] for k in n]
    return np.abs(np.array(response) @ [1, -1]) * np.abs(np.sinc(n * FOOTPRINT)) / SPEED
