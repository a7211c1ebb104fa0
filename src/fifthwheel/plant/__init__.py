"""The nonlinear truck that estimators are tried on: a multibody model on MuJoCo that owes nothing to `dynamics`."""

from fifthwheel.plant.courses import COURSES, Course, OpenLoop, Path, course
from fifthwheel.plant.driver import Driver, DriverSettings
from fifthwheel.plant.properties import Properties
from fifthwheel.plant.sensors import Sensor, article, observe
from fifthwheel.plant.truck import Drive, Plant
from fifthwheel.plant.tyre import MagicFormula

__all__ = [
    "COURSES",
    "Course",
    "Drive",
    "Driver",
    "DriverSettings",
    "MagicFormula",
    "OpenLoop",
    "Path",
    "Plant",
    "Properties",
    "Sensor",
    "article",
    "course",
    "observe",
]
