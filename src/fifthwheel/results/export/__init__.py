"""Estimators in other languages, C99 and functional mock-up units, and states for other tools.

learner_model  the generated C of one learner: functions, names and constants
c_text         signals, numbers and tables as C
project        the folder with library, build file and test program, and the generated C of one observer
fmu            functional mock-up units of an observer and of the linear truck
mf4, ros2      states as an MDF file, and as messages of ROS 2
"""

from fifthwheel.results.export.fmu import PLATFORMS, export_fmu
from fifthwheel.results.export.project import FILES, LEARNER_FILES, export_c

__all__ = ["FILES", "LEARNER_FILES", "PLATFORMS", "export_c", "export_fmu"]
