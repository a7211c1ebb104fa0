"""Manoeuvres of the linear model and of the nonlinear plant, in one catalogue.

catalogue       MANOEUVRES: every name with the forms in which it exists; courses by name
accelerations   lateral acceleration over time, for the linear model; waveforms for all
open_loops      steer angle over time, for both
paths           paths for a driver, for the plant
courses         the data of an open loop and of a path
lane_change     the lane change of SAE J2179, as an acceleration and as a path
candidates      manoeuvres that the experiment design chooses from
linear          steer angle from lateral acceleration by the linear model, and the reverse
"""

from fifthwheel.model.manoeuvres.catalogue import (
    LINEAR_MANOEUVRES,
    MANOEUVRES,
    PLANT_MANOEUVRES,
    acceleration_course,
    course,
    linear_course,
)
from fifthwheel.model.manoeuvres.courses import Course, OpenLoop, Path, braked
from fifthwheel.model.manoeuvres.lane_change import LaneChange, lane_changes, lane_changes_on_test_track
from fifthwheel.model.manoeuvres.linear import inverse_steer
from fifthwheel.model.manoeuvres.open_loops import single_sine, step_input
from fifthwheel.model.manoeuvres.paths import constant_radius, everyday, slow_turns, straight

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
