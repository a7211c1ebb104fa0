"""Kalman, dual extended Kalman and smoother over any symbolic model; no vehicle in here."""

from fifthwheel.filters import consistency, dual, kalman, smoother
from fifthwheel.filters.kalman import Filtered, Noise
from fifthwheel.filters.model import Model, sample_rows

__all__ = ["Filtered", "Model", "Noise", "consistency", "dual", "kalman", "sample_rows", "smoother"]
