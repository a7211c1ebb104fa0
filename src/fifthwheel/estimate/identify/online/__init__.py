"""On-line identification: a joint filter of states and parameters, sample by sample."""

from fifthwheel.estimate.identify.online.learner import LearnedValue, Learner
from fifthwheel.estimate.identify.online.settings import LearnerSettings

__all__ = ["LearnedValue", "Learner", "LearnerSettings"]
