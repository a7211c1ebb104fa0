"""Monte Carlo studies, and published studies reproduced with this package."""

from fifthwheel.apps.studies.estimators import (
    Estimates,
    Estimator,
    Identified,
    Learned,
    ParameterEstimate,
    StateEstimator,
    StateHistory,
    StatesOf,
    observer,
)
from fifthwheel.apps.studies.monte_carlo import study
from fifthwheel.apps.studies.scenarios import SimulatedRun, exact_guess, initial_guess

__all__ = [
    "Estimates",
    "Estimator",
    "Identified",
    "Learned",
    "ParameterEstimate",
    "SimulatedRun",
    "StateEstimator",
    "StateHistory",
    "StatesOf",
    "exact_guess",
    "initial_guess",
    "observer",
    "study",
]
