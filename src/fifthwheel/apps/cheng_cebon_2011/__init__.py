"""The article: C. Cheng and D. Cebon (2011), Vehicle System Dynamics 49. Its method and its results, reproduced.

settings, dual, problem, stage, posterior, estimator   the identification in two stages by a dual Kalman filter
experiments, outcomes, comparison, table, figures     every published number beside ours, and its Figures 4 to 9
"""

from fifthwheel.apps.cheng_cebon_2011.estimator import identify_two_stage
from fifthwheel.apps.cheng_cebon_2011.settings import TwoStage, article

__all__ = ["TwoStage", "article", "identify_two_stage"]
