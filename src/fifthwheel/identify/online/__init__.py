"""On-line identification: a joint filter of states and parameters, sample by sample.

learner       Learner: push samples, read estimates, couple another trailer, save and load
settings      LearnerSettings
problem       the unknowns, the signals and the model of a learner
online_model  the model with the unknowns as parameters, and with discrepancies
live_filter   the filter: one sample in, status out; statistics of its innovations
start         the steady state at which it starts, as a function of the unknowns
steering      inputs of the model from the steer angles, and whether the driver steers enough to learn from a sample
evidence      doubts
persistence   estimates in a JSON file, and estimates of trailers that are not coupled
"""

from fifthwheel.identify.online.learner import LearnedValue, Learner
from fifthwheel.identify.online.settings import LearnerSettings

__all__ = ["LearnedValue", "Learner", "LearnerSettings"]
