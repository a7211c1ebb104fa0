"""An own estimator: a Rao-Blackwellised particle filter of states and parameters.

    python examples/particle_filter.py

A particle is a set of cornering stiffnesses and yaw inertia. With these numbers the model is linear, so each particle
has a Kalman filter of the states, and its weight is the likelihood of the innovations (Doucet et al. 2000). When few
particles have most of the weight, they are drawn again from their distribution, smoothed by a kernel that keeps mean
and covariance (Liu and West 2001). The model of each particle is `fifthwheel.linear_system` at constant speed.
"""

from dataclasses import dataclass

import numpy as np
from compare import compare
from unscented_filter import INITIAL_VARIANCE, PROCESS_VARIANCE, Estimate, estimated, white_noise_variance

import fifthwheel as fw
from fifthwheel.data.channels import SignalName

SHRINKAGE = 0.95
"""Of the kernel of Liu and West: 1 draws particles again without change."""


@dataclass(frozen=True)
class ParticleFilter:
    """States and parameters; an `Estimator`."""

    particles: int = 100
    prior: float = 0.2
    """Prior sigma of each parameter, relative."""
    seed: int = 0

    def __call__(self, record: fw.Record, vehicle: fw.Vehicle, /) -> fw.Estimates:
        """Filter a record of constant speed and sampling rate."""
        random = np.random.default_rng(self.seed)
        truck = vehicle.with_logged_steering(record.signals, record.name)
        names, values = estimated(truck), truck.parameters()
        initial = np.array([values[name] for name in names])
        measured = [name for name in record.signals if SignalName.of(name).quantity in ("yaw_rate", "roll_rate")]
        reported = [f"{quantity}.{unit.name}" for quantity in ("sideslip", "roll") for unit in truck.units]
        speed, dt, m = float(np.mean(record.input("speed"))), 1 / record.rate, len(measured)

        def models(theta: np.ndarray) -> tuple[np.ndarray, ...]:
            """F, G, H and C of every particle."""
            made = []
            for row in theta:
                system = fw.linear_system(
                    truck.replace(dict(zip(names, initial * np.exp(row), strict=True))), speed, [*measured, *reported]
                )
                made.append((*system.step(dt), system.C))
            return tuple(map(np.array, zip(*made, strict=True)))

        system = fw.linear_system(truck, speed, measured)
        n = len(system.states)
        Q = dt * np.diag([PROCESS_VARIANCE[SignalName.of(name).quantity] for name in system.states])
        R = np.diag([white_noise_variance(record.signals[name]) for name in measured])
        steer = np.column_stack([record.input(name) for name in system.inputs])
        samples = np.column_stack([record.signals[name] for name in measured])

        theta = self.prior * random.normal(size=(self.particles, len(names)))
        F, G, H, C = models(theta)
        x, P = np.zeros((self.particles, n)), np.tile(INITIAL_VARIANCE * np.eye(n), (self.particles, 1, 1))
        log_weight = np.zeros(self.particles)
        states = np.empty((len(record), len(reported)))
        for i, sample in enumerate(samples):
            if i:
                x = (F @ x[:, :, None])[:, :, 0] + G @ steer[i - 1] + H @ steer[i]
                P = F @ P @ F.transpose(0, 2, 1) + Q
            if np.isfinite(sample).all():
                c = C[:, :m]
                innovation = sample - (c @ x[:, :, None])[:, :, 0]
                S = c @ P @ c.transpose(0, 2, 1) + R
                K = np.linalg.solve(S, c @ P).transpose(0, 2, 1)
                x = x + (K @ innovation[:, :, None])[:, :, 0]
                P = P - K @ S @ K.transpose(0, 2, 1)
                squared = np.sum(innovation * np.linalg.solve(S, innovation[:, :, None])[:, :, 0], axis=1)
                log_weight -= (squared + np.linalg.slogdet(S)[1]) / 2
            weight = np.exp(log_weight - log_weight.max())
            weight /= weight.sum()
            states[i] = weight @ (C[:, m:] @ x[:, :, None])[:, :, 0]
            if 1 / np.sum(weight**2) < self.particles / 2 and i + 1 < len(record):
                theta, chosen = self._draw_again(theta, weight, random)
                x, P, log_weight = x[chosen], P[chosen], np.zeros(self.particles)
                F, G, H, C = models(theta)
        mean, covariance = _moments(theta, weight)
        final, sigma = initial * np.exp(mean), np.sqrt(np.diag(covariance))
        return fw.Estimates(
            parameters=[Estimate(*row) for row in zip(names, final, final * sigma, strict=True)],
            states=dict(zip(reported, states.T, strict=True)),
        )

    def _draw_again(
        self, theta: np.ndarray, weight: np.ndarray, random: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """Parameters of the new particles, and the old particles that they come from."""
        positions = (np.arange(self.particles) + random.random()) / self.particles
        chosen = np.minimum(np.searchsorted(np.cumsum(weight), positions), self.particles - 1)
        mean, covariance = _moments(theta, weight)
        noise = random.multivariate_normal(np.zeros(len(mean)), (1 - SHRINKAGE**2) * covariance, self.particles)
        return SHRINKAGE * theta[chosen] + (1 - SHRINKAGE) * mean + noise, chosen


def _moments(theta: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weighted mean and covariance."""
    mean = weight @ theta
    return mean, (theta - mean).T @ ((theta - mean) * weight[:, None])


if __name__ == "__main__":
    compare({"particle filter": ParticleFilter()})
