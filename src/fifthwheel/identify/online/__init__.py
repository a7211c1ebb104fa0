"""On-line identification: a joint filter of states and parameters, sample by sample.

learner       Learner: push samples, read estimates, couple another trailer, save and load
settings      LearnerSettings
problem       the estimated unknowns, the signals and the model of a learner
live_filter   the filter: one sample in, status out
inputs        speed and steer angles, each held at its last plausible value
excitation    whether the driver steers enough to learn from a sample
persistence   estimates in a JSON file, and estimates of trailers that are not coupled
"""

from fifthwheel.identify.online.learner import LearnedValue, Learner
from fifthwheel.identify.online.settings import LearnerSettings

__all__ = ["LearnedValue", "Learner", "LearnerSettings"]
