"""The height of a rough road below every wheel: two tracks with the spectrum of ISO 8608.

The one-sided density of the height over the spatial frequency n, 1/m, is that to which the standard fits a road,

    G_d(n) = G_d(n_0) (n / n_0)^-2,    n_0 = 0.1 1/m,    0.011 1/m <= n <= 2.83 1/m,

and 0 elsewhere. The surface is isotropic, so that this spectrum also gives the correlation of two tracks: the cross
density of left and right divided by G_d is

    c(n) = z K_1(z),    z = 2 pi n b,

with the distance b of the tracks and the modified Bessel function K_1. The mean of both tracks then has the density
G_d (1 + c) / 2, half their difference G_d (1 - c) / 2, and the two are independent. Each is a sum of cosines with
random phases. K. M. A. Kamash and J. D. Robson, The application of isotropy in road surface modelling, Journal of Sound
and Vibration 57 (1978).
"""

import numpy as np

from fifthwheel.base.types import Array

REFERENCE = 0.1
"""Spatial frequency n_0 at which the roughness is stated, 1/m."""
BAND = (0.011, 2.83)
"""Spatial frequencies of the road, 1/m; the range of the fits of ISO 8608."""
STEP, COUNT = 0.05, 2**18
"""Distance between the points of a track, m, and their number: the road repeats itself after 13.1 km."""
LEAD = 10.0
"""Distance over which the road of a run becomes rough, m, while the truck drives straight ahead before time 0."""


def tracks(roughness: float, distance: float, seed: int) -> Array:
    """Height, m, and slope of the left and the right track at every `STEP`, (2, 2, `COUNT`): [quantity, side, point].

    Of the roughness G_d(n_0), m^3, class B of ISO 8608 having 64e-6, the distance of the tracks, m, and the seed of the
    phases.

    Example:
        >>> height, slope = tracks(64e-6, 2.0, seed=0)
        >>> bool(abs(height.std() - 0.0076) < 1e-4)  # G_d(n_0) n_0^2 (1 / 0.011 m - 1 / 2.83 m), its square root
        True
    """
    from scipy.special import k1  # slow to import

    n = np.fft.rfftfreq(COUNT, STEP)
    inside = (n >= BAND[0]) & (n <= BAND[1])
    n = n[inside]
    z = 2 * np.pi * n * distance
    ratio = z * k1(z)
    density = roughness * (REFERENCE / n) ** 2
    phases = np.random.default_rng([seed, 43]).uniform(0.0, 2 * np.pi, (2, n.size))
    mean, difference = np.sqrt(density * np.stack([1 + ratio, 1 - ratio]) / (STEP * COUNT)) * np.exp(1j * phases)
    sides = np.stack([mean + difference, mean - difference])
    spectrum = np.zeros((2, 2, inside.size), dtype=np.complex128)
    spectrum[..., inside] = sides, 2j * np.pi * n * sides
    return np.asarray(np.fft.irfft(spectrum, COUNT) * (COUNT / 2))


class RoughRoad:
    """The road of one run, which every wheel of a side passes over, each at its distance behind the first one."""

    def __init__(self, roughness: float, distance: float, positions: Array, seed: int) -> None:
        """Roughness, distance of the tracks and seed as in `tracks`; positions of the axles, (axles,), m."""
        self._tracks = tracks(roughness, distance, seed)
        self._positions = positions
        self._travelled = 0.0

    def ahead(self, speed: float, time_step: float, steps: int) -> Array:
        """Height, m, and its rate, m/s, under every wheel in the next time steps, s, at a speed, m/s: (steps,
        2 * wheels), heights first."""
        travelled = self._travelled + speed * time_step * np.arange(steps)[:, None]
        self._travelled += speed * time_step * steps
        place = (travelled + self._positions) / STEP
        index = np.floor(place).astype(int)
        low, high = self._tracks[..., index % COUNT], self._tracks[..., (index + 1) % COUNT]
        height, slope = low + (place - index) * (high - low)  # (side, step, axle)
        fraction = np.clip(travelled / LEAD, 0.0, 1.0)
        rate = speed * (fraction * slope + (fraction < 1) * height / LEAD)
        of_wheels = np.stack([fraction * height, rate]).transpose(2, 0, 3, 1)  # (step, quantity, axle, side)
        return np.ascontiguousarray(of_wheels.reshape(steps, -1))
