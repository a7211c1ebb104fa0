"""On-line identification: a joint filter of states and parameters, sample by sample."""

from fifthwheel.identify.online.learner import LearnedValue, Learner
from fifthwheel.identify.online.settings import LearnerSettings

__all__ = ["LearnedValue", "Learner", "LearnerSettings"]
