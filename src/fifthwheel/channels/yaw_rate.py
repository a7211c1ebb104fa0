"""Yaw rate of a unit."""

from fifthwheel.channels.channel import (
    DEGREES,
    Channel,
    ErrorKind,
    Exchange,
    NamePattern,
    SensorModel,
    SignalLimits,
    StateNoise,
    TurnRelation,
)

AXIS_WORDS = "(ang[a-z]*|rotation[a-z]*)_?(vel[a-z]*|rate)"
"""Words for an angular rate, before the name of its axis."""

GYRO_ERRORS = (
    ErrorKind(kind="offset", setting="rate_offset", per_log=True),
    ErrorKind(kind="gain", setting="rate_gain"),
    ErrorKind(kind="misalignment", setting="misalignment"),
)

YAW_RATE = Channel(
    quantity="yaw_rate",
    unit="rad/s",
    patterns=(
        NamePattern(pattern="yaw_?(rate|vel)|gier_?(rate|geschw|winkelgeschw)|_psi_?(p|dot)_"),
        NamePattern(pattern=f"gyr[a-z]*?_?z_|_(gz|wz|avz|omega_?z)_|_{AXIS_WORDS}_(z|down|up)_|_rate_(body|hor)_z_"),
        NamePattern(pattern="_(yaw|gier)_", excluded="_[alr]\\d_", generic=True),
    ),
    proposed="signal",
    limit=SignalLimits(magnitude=1.5, jump=0.15, turn=0.03),
    turn=TurnRelation(
        expected=lambda turn: turn.towed_yaw_rate if turn.is_towed else turn.yaw_rate,
        least_sigma=0.01,
        gain_faults=DEGREES,
        largest_offset=0.02,
        longest_lead=0.4,
    ),
    noise=(1.52e-5, 1.11e-5),  # equation (12) of the article
    discrepancy=0.0025,
    shows_clock=True,
    exchange=Exchange(margin=1.0, least_explained=0.9),
    state=StateNoise(process=6e-4**2, observer_process=1e-3**2, initial_sigma=0.01),
    model=SensorModel(
        value=lambda now, i, _: now.motion.r[i],
        rate=lambda now, i, _: now.acceleration[i][1],
        cross_axis=lambda now, i: now.motion.roll_rate[i],
    ),
    errors=GYRO_ERRORS,
)
