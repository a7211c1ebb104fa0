"""Kalman filter, joint filter and smoother for symbolic models, and the inputs that they need for a vehicle.

kalman, joint, relinearised, tangent and model accept any symbolic model.
variances, initial_state and step_rows provide the noise variances, initial states and sample rows of a vehicle model.
"""

from fifthwheel.estimate.filters.kalman import Noise
from fifthwheel.estimate.filters.model import Model, sample_rows

__all__ = ["Model", "Noise", "sample_rows"]
