"""Rotation of units: yaw rate, articulation angle, and roll rate and roll angle of the sprung body."""

import math

import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.data.channels.channel import (
    DEGREES,
    DELAY,
    GAIN,
    Channel,
    ErrorKind,
    Exchange,
    GainFault,
    NamePattern,
    SensorModel,
    SignalLimits,
    StateNoise,
    Turn,
    TurnRelation,
)

AXIS_WORDS = "(ang[a-z]*|rotation[a-z]*)_?(vel[a-z]*|rate)"
"""Words for an angular rate, before the name of its axis."""

GYRO_ERRORS = (
    ErrorKind(kind="offset", prior=0.004, per_log=True, gross=0.04),
    GAIN(prior=0.005),
    ErrorKind(kind="misalignment", unit="rad", prior=math.radians(1), gross=0.4),  # a bracket is square to 1 degree
    DELAY(prior=0.01, uncertain=True),
)

YAW_RATE = Channel(
    quantity="yaw_rate",
    unit="rad/s",
    patterns=(
        NamePattern(
            pattern="yaw_?(rate|vel)|gier_?(rate|geschw|winkelgeschw)|_psi_?(p|dot)_|(vitesse|taux)_(de_)?lacet"
        ),
        NamePattern(pattern=f"gyr[a-z]*?_?z_|_(gz|wz|avz|omega_?z)_|_{AXIS_WORDS}_(z|down|up)_|_rate_(body|hor)_z_"),
        NamePattern(pattern="_(yaw|gier|lacet|psi)_", excluded="_[alr]\\d_", generic=True),
    ),
    proposed="signal",
    limit=SignalLimits(magnitude=1.5, jump=0.15, turn=0.03),
    turn=TurnRelation(
        expected=lambda turn: turn.unit_yaw_rate,
        least_sigma=0.01,
        gain_faults=DEGREES,
        largest_offset=0.02,
        longest_lead=0.4,
    ),
    noise=(1.52e-5, 1.11e-5),  # equation (12) of the article
    discrepancy=0.005,
    shows_clock=True,
    exchange=Exchange(margin=1.0, least_explained=0.9),
    state=StateNoise(process=6e-4**2, observer_process=1e-3**2, initial_sigma=0.01),
    model=SensorModel(
        value=lambda now, i, _: now.motion.r[i],
        rate=lambda now, i, _: now.acceleration[i][1],
        sensitivities={"misalignment": lambda now, i, _: now.motion.roll_rate[i]},
    ),
    errors=GYRO_ERRORS,
)

ARTICULATION = Channel(
    quantity="articulation",
    unit="rad",
    patterns=(NamePattern(pattern="articulat|hitch|knick|attelage|coupling_angle|_gamma_|_art_h_"),),
    proposed="signal",
    limit=SignalLimits(magnitude=1.7, jump=0.06, turn=0.02),
    turn=TurnRelation(
        expected=lambda turn: -turn.towed_yaw_rate * turn.towed_length / turn.speed,
        least_sigma=0.01,
        gain_faults=DEGREES,
        largest_offset=0.04,
    ),
    noise=(0.005**2, 0.005**2),
    discrepancy=0.006,  # the fraction of its signal that the yaw rate has
    shows_clock=True,
    state=StateNoise(process=3e-5**2, observer_process=1e-3**2, initial_sigma=0.01),
    model=SensorModel(
        value=lambda now, i, _: now.motion.articulation[i],
        rate=lambda now, i, _: now.motion.r[i] - now.motion.r[i - 1],
        behind_coupling=True,
    ),
    errors=(ErrorKind(kind="offset", prior=0.01, per_log=True, gross=0.05),),
)
"""The heading of a unit less that of the unit in front of it."""

ROLL_GRADIENT = 0.03
"""rad s^2/m; roll angle of a body by lateral acceleration."""
ROLL_LAG = 0.15
"""s; two first-order lags of this time constant approximate the roll mode: 1 Hz, well damped."""


def _in_turn(turn: Turn) -> Array:
    """Roll rate (N,) of a body that rolls outwards by the lateral acceleration of its unit, rad/s."""
    acceleration = turn.speed * turn.own_yaw_rate
    for _ in range(2):
        acceleration = turn.lagged(acceleration, ROLL_LAG)
    return np.asarray(ROLL_GRADIENT * np.gradient(acceleration, turn.step))


ROLL_RATE = Channel(
    quantity="roll_rate",
    of_roll=True,
    unit="rad/s",
    patterns=(
        NamePattern(
            pattern="roll_?(rate|vel)|wank_?(rate|geschw|winkelgeschw)|_phi_?(p|dot)_|(vitesse|taux)_(de_)?roulis"
        ),
        NamePattern(pattern=f"gyr[a-z]*?_?x_|_(gx|wx|avx|omega_?x)_|_{AXIS_WORDS}_(x|forward)_|_rate_(body|hor)_x_"),
        NamePattern(pattern="_(roll|wank|roulis|phi)_", excluded="_[alr]\\d_", generic=True),
    ),
    proposed="signal",
    limit=SignalLimits(magnitude=2.0, jump=0.4),
    turn=TurnRelation(
        expected=_in_turn, least_sigma=0.003, gain_faults=(GainFault("degrees", 20, np.inf),), has_other_causes=True
    ),
    noise=(4.52e-4, 4.70e-5),  # equation (12) of the article
    discrepancy=0.001,
    shows_clock=True,
    exchange=Exchange(margin=0.3, least_explained=0.5),  # roll rates of coupled units are similar
    state=StateNoise(process=1.2e-3**2, observer_process=1e-3**2, initial_sigma=0.02),
    model=SensorModel(
        value=lambda now, i, _: now.motion.roll_rate[i],
        rate=lambda now, i, _: now.acceleration[i][2],
        sensitivities={"misalignment": lambda now, i, _: now.motion.r[i]},
        needs_roll=True,
    ),
    errors=GYRO_ERRORS,
)

ROLL = Channel(
    quantity="roll",
    of_roll=True,
    unit="rad",
    patterns=(
        NamePattern(pattern="_roll(_?angle)?_|wank_?winkel|_phi_|angle_(de_)?roulis", excluded="_[alr]\\d_"),
        NamePattern(pattern="_(wank|roulis)_", generic=True),
    ),
    proposed="signal",
    limit=SignalLimits(magnitude=0.5, jump=0.05, turn=0.02),
    noise=(0.005**2, 0.005**2),
    state=StateNoise(process=3e-5**2, observer_process=1e-3**2, initial_sigma=0.005),
    model=SensorModel(value=lambda now, i, _: now.motion.roll[i], needs_roll=True),
)
