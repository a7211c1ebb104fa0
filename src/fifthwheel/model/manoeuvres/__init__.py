"""Manoeuvres of the linear model and of the nonlinear plant, in one catalogue.

catalogue       MANOEUVRES: every name with the forms in which it exists; courses by name
accelerations   lateral acceleration over time, for the linear model, and its inverse; waveforms for all
open_loops      steer angle over time, for both
courses         the data of an open loop and of a path; the lane change of SAE J2179, and paths for a driver
candidates      manoeuvres that the experiment design chooses from
"""

from fifthwheel.model.manoeuvres.accelerations import inverse_steer
from fifthwheel.model.manoeuvres.catalogue import (
    LINEAR_MANOEUVRES,
    MANOEUVRES,
    PLANT_MANOEUVRES,
    acceleration_course,
    course,
    linear_course,
)
from fifthwheel.model.manoeuvres.courses import (
    Course,
    LaneChange,
    OpenLoop,
    Path,
    braked,
    constant_radius,
    everyday,
    lane_changes,
    lane_changes_on_test_track,
    slow_turns,
    straight,
)
from fifthwheel.model.manoeuvres.open_loops import single_sine, step_input

__all__ = [
    "LINEAR_MANOEUVRES",
    "MANOEUVRES",
    "PLANT_MANOEUVRES",
    "Course",
    "LaneChange",
    "OpenLoop",
    "Path",
    "acceleration_course",
    "braked",
    "constant_radius",
    "course",
    "everyday",
    "inverse_steer",
    "lane_changes",
    "lane_changes_on_test_track",
    "linear_course",
    "single_sine",
    "slow_turns",
    "step_input",
    "straight",
]
