"""A physically consistent run, and the folder of logs that are not part of the project."""

import os
from pathlib import Path

import numpy as np
import pytest

from fifthwheel.data.record import Record


def weaving_truck(
    *, speed: float = 18.0, duration: float = 40.0, rate: float = 50.0, noise: float = 1.0, seed: int = 0
) -> Record:
    """Record of a single-track tractor (linear tyres) with a kinematic semitrailer in weaves and bends, with noise.

    speed m/s, duration s, rate Hz. The sign of the articulation follows from geometry, not from the code under test.
    """
    mass, inertia, a, b, cf, cr, towed = 9000.0, 30000.0, 1.4, 2.6, 3.0e5, 6.0e5, 9.0
    substeps = 5
    step = 1 / (rate * substeps)
    t = np.arange(0, duration, step)
    steer = 0.03 * np.sin(0.8 * t) + 0.02 * np.sin(2.3 * t + 1) * (np.sin(0.3 * t) > 0) + 0.01 * np.sin(0.15 * t)
    steer[t < 2] = 0.0
    u = speed + np.sin(0.2 * t)
    v = r = psi1 = psi2 = 0.0
    rows = []
    for k in range(t.size):
        force_f = cf * (steer[k] - (v + a * r) / u[k])
        force_r = -cr * (v - b * r) / u[k]
        turn2 = u[k] / towed * np.sin(psi1 - psi2)
        rows.append((r, turn2, psi2 - psi1, (force_f + force_r) / mass, v))
        v += step * ((force_f + force_r) / mass - u[k] * r)
        r += step * (a * force_f - b * force_r) / inertia
        psi1, psi2 = psi1 + step * rows[-1][0], psi2 + step * turn2
    x = np.array(rows)[::substeps]
    random = np.random.default_rng(seed)

    def noisy(values, sigma):
        return values + noise * sigma * random.standard_normal(values.size)

    return Record(
        time=t[::substeps],
        signals={
            "speed": noisy(u[::substeps], 0.05),
            "steer.tractor.front": noisy(steer[::substeps], 0.0005),
            "yaw_rate.tractor": noisy(x[:, 0], 0.003),
            "yaw_rate.semitrailer": noisy(x[:, 1], 0.003),
            "articulation.semitrailer": noisy(x[:, 2], 0.002),
            "lateral_acceleration.tractor": noisy(x[:, 3], 0.1),
        },
        reference={"lateral_velocity.tractor": x[:, 4]},
        name="weaving",
    )


@pytest.fixture(scope="session")
def weaving() -> Record:
    return weaving_truck()


@pytest.fixture(scope="session")
def data() -> Path:
    """Folder of logs that are not part of the project; tests are skipped without it."""
    folder = Path(os.environ.get("FIFTHWHEEL_DATA", Path(__file__).resolve().parents[4] / "shared" / "data"))
    if not (folder / "real_truck").is_dir():
        pytest.skip("no external logs; set FIFTHWHEEL_DATA to their folder")
    return folder
