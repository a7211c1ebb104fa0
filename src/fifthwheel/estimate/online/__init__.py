"""On-line identification: a joint filter of states and parameters, sample by sample."""

from fifthwheel.estimate.online.learner import LearnedValue, Learner
from fifthwheel.estimate.online.settings import LearnerSettings

__all__ = ["LearnedValue", "Learner", "LearnerSettings"]
