"""Fleets drawn from the model of the combination itself: trips with random information, for Monte Carlo tests."""

import datetime

import numpy as np

from fifthwheel.estimate.filters.model import pack_array

START = datetime.datetime(2026, 1, 1, tzinfo=datetime.UTC)
PARAMETERS = {
    "tractor.front.cornering_stiffness": 0.3,
    "tractor.drive.cornering_stiffness": 0.3,
    "semitrailer.cornering_stiffness": 0.3,
    "semitrailer.yaw_inertia": 0.3,
    "semitrailer.payload.height": 1.0,
}
SENSORS = {"steer.tractor.front.gain": 0.15, "yaw_rate.tractor.gain": 0.005}
UNCERTAIN = {"tractor.mass": 1.0, "semitrailer.mass": 1.0}
NAMES = (*PARAMETERS, *SENSORS, *UNCERTAIN)
SCALES = np.array([*PARAMETERS.values(), *SENSORS.values(), *UNCERTAIN.values()])
LOGARITHMIC = np.array([not n.endswith((".gain", ".height", ".mass")) for n in NAMES])
CENTRES = np.array([4e5, 7e5, 1.2e6, 4e5, 1.0, 1.0, 1.0, 0.0, 0.0])
INFORMED = len(PARAMETERS) + len(SENSORS)
"""Unknowns that a trip informs; it does not separate the uncertain numbers from them."""


def value(z, i):
    """Value of unknown i at z, SI."""
    return CENTRES[i] * np.exp(SCALES[i] * z) if LOGARITHMIC[i] else CENTRES[i] + SCALES[i] * z


class Synthetic:
    """One truck: its true unknowns from the prior, and trips of them."""

    def __init__(self, rng, *, uncertain=True):
        self.rng = rng
        self.z = rng.standard_normal(len(NAMES))
        effect = 0.15 * rng.standard_normal((INFORMED, len(UNCERTAIN)))
        self.z[INFORMED:] *= uncertain
        self.seen = np.hstack([np.eye(INFORMED), effect * uncertain])  # the combinations of z in the trips

    def step(self, days, walk):
        """The tyres drift for some days."""
        self.z[:3] += walk / SCALES[:3] * np.sqrt(days) * self.rng.standard_normal(3)

    def trip(self, day, *, sigma=0.03, trailer="A", load="steel"):
        """The row of a trip whose parameters have about this relative sigma."""
        k = INFORMED
        root = self.rng.standard_normal((3 * k, k)) / np.sqrt(3 * k)
        strength = np.where(np.arange(k) < len(PARAMETERS), SCALES[:k] / sigma, 1.0)
        root = root * strength @ self.seen
        H, noise = root.T @ root, root.T @ self.rng.standard_normal(3 * k)
        return {
            "log": f"{day}",
            "truck": "T",
            "trailer": trailer,
            "load": load,
            "tractor": "tractor",
            "units": [],
            "date": START + datetime.timedelta(days=day),
            "digest": f"{day}",
            "estimates": [{"name": n} for n in PARAMETERS],
            "information": {
                "names": list(NAMES),
                "centre": CENTRES.tolist(),
                "scale": SCALES.tolist(),
                "logarithmic": LOGARITHMIC.tolist(),
                "non_negative": [False] * len(H),
                "vector": (H @ self.z + noise).tolist(),
                "information": pack_array(H).tolist(),
                "score_covariance": pack_array(H).tolist(),
                "factors": [],
                "origins": [""] * len(NAMES),
            },
        }
