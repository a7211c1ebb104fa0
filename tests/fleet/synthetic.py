"""Fleets drawn from the model of the combination itself: trips with random information, for Monte Carlo tests."""

import datetime

import numpy as np

START = datetime.datetime(2026, 1, 1, tzinfo=datetime.UTC)
PARAMETERS = {
    "tractor.front.cornering_stiffness": 0.3,
    "tractor.drive.cornering_stiffness": 0.3,
    "semitrailer.cornering_stiffness": 0.3,
    "semitrailer.yaw_inertia": 0.3,
    "semitrailer.payload.height": 1.0,
}
SENSORS = {"steer.tractor.front.gain": 0.15, "yaw_rate.tractor.gain": 0.005}
NAMES = (*PARAMETERS, *SENSORS)
SCALES = np.array([*PARAMETERS.values(), *SENSORS.values()])
LOGARITHMIC = np.array([not n.endswith((".gain", ".height")) for n in NAMES])
CENTRES = np.array([4e5, 7e5, 1.2e6, 4e5, 1.0, 1.0, 1.0])
CONSIDERED = ("tractor.mass", "semitrailer.mass")


def value(z, i):
    """Value of unknown i at z, SI."""
    return CENTRES[i] * np.exp(SCALES[i] * z) if LOGARITHMIC[i] else CENTRES[i] + SCALES[i] * z


class Synthetic:
    """One truck: its true unknowns from the prior, and trips of them."""

    def __init__(self, rng, *, considered=True):
        self.rng = rng
        self.z = rng.standard_normal(len(NAMES))
        self.c = rng.standard_normal(len(CONSIDERED)) if considered else np.zeros(len(CONSIDERED))
        self.G = 0.15 * rng.standard_normal((len(NAMES), len(CONSIDERED)))

    def step(self, days, walk):
        """The tyres drift for some days."""
        self.z[:3] += walk / SCALES[:3] * np.sqrt(days) * self.rng.standard_normal(3)

    def trip(self, day, *, sigma=0.03, trailer="A", load="steel"):
        """The row of a trip whose parameters have about this relative sigma."""
        k = len(NAMES)
        root = self.rng.standard_normal((3 * k, k)) / np.sqrt(3 * k)
        strength = np.where(np.arange(k) < len(PARAMETERS), SCALES / sigma, 1.0)
        H = (root * strength).T @ (root * strength)
        coupling = H @ self.G
        noise = np.linalg.cholesky(H) @ self.rng.standard_normal(k)
        return {
            "log": f"{day}",
            "truck": "T",
            "trailer": trailer,
            "load": load,
            "tractor": "tractor",
            "date": START + datetime.timedelta(days=day),
            "digest": f"{day}",
            "estimates": [],
            "unknowns": [
                {"name": n, "centre": c, "scale": s, "logarithmic": g, "non_negative": False}
                for n, c, s, g in zip(NAMES, CENTRES.tolist(), SCALES.tolist(), LOGARITHMIC.tolist(), strict=True)
            ],
            "considered": list(CONSIDERED),
            "vector": (H @ self.z + coupling @ self.c + noise).tolist(),
            "information": H.ravel().tolist(),
            "score_covariance": H.ravel().tolist(),
            "coupling": coupling.ravel().tolist(),
        }
