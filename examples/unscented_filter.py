"""An own estimator: an unscented Kalman filter of states and parameters, with filterpy.

    python examples/unscented_filter.py

The state is that of the linear model with the logarithms of three cornering stiffnesses and the trailer's yaw inertia,
relative to their initial values. The step of the model comes from `fifthwheel.model.dynamics.model`. The sigma points
are those of Julier with kappa = 0, which keep the covariance positive.
"""

from dataclasses import dataclass

import numpy as np
from compare import compare
from filterpy.kalman import JulierSigmaPoints, UnscentedKalmanFilter

import fifthwheel as fw
from fifthwheel.base.names import ParameterPath
from fifthwheel.data.channels import SignalName
from fifthwheel.model import dynamics

PROCESS_VARIANCE = {
    "lateral_velocity": 4e-4,
    "yaw_rate": 1e-6,
    "articulation": 1e-6,
    "roll": 1e-6,
    "roll_rate": 1e-6,
    "slip_angle": 1e-9,
}
"""Of each state per second, SI squared: as of `Observer`, from equation (14) of Cheng and Cebon (2011)."""
INITIAL_VARIANCE = 1e-6
"""Of each state: the run starts straight."""


@dataclass(frozen=True)
class Estimate:
    """One parameter, as a study expects it."""

    name: str
    value: float
    sigma: float
    verdict: str = ""


@dataclass(frozen=True)
class UnscentedFilter:
    """States and parameters; an `Estimator`."""

    prior: float = 0.2
    """Prior sigma of each parameter, relative."""

    def __call__(self, record: fw.Record, vehicle: fw.Vehicle, /) -> fw.Estimates:
        """Filter a record whose samples are at most 10 ms apart."""
        truck = vehicle.with_logged_steering(record.signals, record.name)
        measured = [name for name in record.signals if SignalName.of(name).quantity in ("yaw_rate", "roll_rate")]
        reported = [f"{quantity}.{unit.name}" for quantity in ("sideslip", "roll") for unit in truck.units]
        model = dynamics.model(truck, [*measured, *reported], roll=True, free=estimated(truck))
        values = dynamics.all_parameters(truck, model.outputs)
        initial, known = model.free_values(values), model.known_values(values)
        n, m, k = len(model.states), len(measured), len(model.free)

        def transition(x: np.ndarray, dt: float, d: np.ndarray) -> np.ndarray:
            later = model.transition(x[:n], dt, d, initial * np.exp(x[n:]), known)
            return np.concatenate([later.full().ravel(), x[n:]])

        def outputs(x: np.ndarray, d: np.ndarray) -> np.ndarray:
            return model.observation(x[:n], d, initial * np.exp(x[n:]), known).full().ravel()

        ukf = UnscentedKalmanFilter(
            dim_x=n + k,
            dim_z=m,
            dt=0.0,
            fx=transition,
            hx=lambda x, d: outputs(x, d)[:m],
            points=JulierSigmaPoints(n + k, kappa=0.0),
        )
        ukf.P = np.diag([*[INITIAL_VARIANCE] * n, *[self.prior**2] * k])
        ukf.R = np.diag([white_noise_variance(record.signals[name]) for name in measured])
        rate = np.diag([*(PROCESS_VARIANCE[SignalName.of(name).quantity] for name in model.states), *[0.0] * k])
        inputs = np.column_stack([record.input(name) for name in model.inputs])
        samples = np.column_stack([record.signals[name] for name in measured])
        states = np.empty((len(record), len(reported)))
        for i, sample in enumerate(samples):
            d = np.concatenate([inputs[max(i - 1, 0)], inputs[i]])
            dt = record.time[i] - record.time[i - 1] if i else 0.0
            ukf.Q = rate * dt
            ukf.predict(dt=dt, d=d)
            if np.isfinite(sample).all():
                ukf.update(sample, d=d)
                ukf.P = (ukf.P + ukf.P.T) / 2
            states[i] = outputs(ukf.x, d)[m:]
        final, sigma = initial * np.exp(ukf.x[n:]), np.sqrt(np.diag(ukf.P)[n:])
        return fw.Estimates(
            parameters=[Estimate(*row) for row in zip(model.free, final, final * sigma, strict=True)],
            states=dict(zip(reported, states.T, strict=True)),
        )


def estimated(truck: fw.Vehicle) -> list[str]:
    """Paths of all cornering stiffnesses and of the last unit's yaw inertia."""
    stiffness = [path for path in truck.parameters() if ParameterPath.of(path).quantity == "cornering_stiffness"]
    return [*stiffness, f"{truck.units[-1].name}.yaw_inertia"]


def white_noise_variance(values: np.ndarray) -> float:
    """Variance of the noise of a signal whose slope changes little from sample to sample."""
    return float(np.nanvar(np.diff(values, 2)) / 6)


if __name__ == "__main__":
    compare({"unscented Kalman filter": UnscentedFilter()})
