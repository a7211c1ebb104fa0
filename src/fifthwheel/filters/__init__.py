"""Kalman filter, joint filter and smoother for symbolic models, and the inputs that they need for a vehicle.

kalman, joint, relinearised, smoother, tangent, consistency and model accept any symbolic model.
variances, initial_state and step_rows provide the noise variances, initial states and sample rows of a vehicle model.
"""

from fifthwheel._moved import moved
from fifthwheel.filters import consistency, kalman, smoother
from fifthwheel.filters.kalman import Filtered, Noise
from fifthwheel.filters.model import Model, sample_rows

__all__ = ["Filtered", "Model", "Noise", "consistency", "kalman", "sample_rows", "smoother"]

__getattr__ = moved(__name__, {"dual": "fifthwheel.cheng_cebon_2011.dual"})
