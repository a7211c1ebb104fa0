"""Articulation angle: the heading of a unit less that of the unit in front of it."""

from fifthwheel.channels.channel import (
    DEGREES,
    Channel,
    ErrorKind,
    NamePattern,
    SensorModel,
    SignalLimits,
    StateNoise,
    TurnRelation,
)

ARTICULATION = Channel(
    quantity="articulation",
    unit="rad",
    patterns=(NamePattern(pattern="articulat|hitch|knick|coupling_angle|_gamma_|_art_h_"),),
    proposed="signal",
    limit=SignalLimits(magnitude=1.7, jump=0.06, turn=0.02),
    turn=TurnRelation(
        expected=lambda turn: -turn.towed_yaw_rate * turn.towed_length / turn.speed,
        least_sigma=0.01,
        gain_faults=DEGREES,
        largest_offset=0.04,
    ),
    noise=(0.005**2, 0.005**2),
    discrepancy=0.003,  # the fraction of its signal that the yaw rate has
    shows_clock=True,
    state=StateNoise(process=3e-5**2, observer_process=1e-3**2, initial_sigma=0.01),
    model=SensorModel(
        value=lambda now, i, _: now.motion.heading[i] - now.motion.heading[i - 1],
        rate=lambda now, i, _: now.motion.r[i] - now.motion.r[i - 1],
        behind_coupling=True,
    ),
    errors=(ErrorKind(kind="offset", setting="articulation_offset", per_log=True),),
)
