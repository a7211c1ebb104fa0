"""Speeds of wheels, and their difference between the sides of an axle."""

from fifthwheel.data.channels.channel import (
    DELAY,
    GAIN,
    Channel,
    ErrorKind,
    NamePattern,
    SensorModel,
    SignalLimits,
    TurnRelation,
)

_HALF_TRACK = 1.0
"""m, typical."""

WHEEL_SPEED = Channel(
    quantity="wheel_speed",
    unit="m/s",
    of="part",
    patterns=(
        NamePattern(
            pattern="(wheel|whl|axle)_?(speed|spd)|rad_?geschw|_v_rad|_spd_fa_|vitesse_(de_)?roue"
            "|_(v|vel|spd|speed)_?(fl|fr|rl|rr|vl|vr|hl|hr)_",
            excluded="steer|lenk|_ang|_rot",
        ),
    ),
    proposed="signal",
    limit=SignalLimits(magnitude=45.0, jump=2.0, may_be_constant=True),
)
WHEEL_SPEED_DIFFERENCE = Channel(
    quantity="wheel_speed_difference",
    unit="1",
    proposed="signal",
    limit=SignalLimits(magnitude=0.5, jump=0.1),
    turn=TurnRelation(
        expected=lambda turn: 2 * _HALF_TRACK * turn.unit_yaw_rate / turn.speed,
        least_sigma=5e-4,
        gain_faults=(),
        sign_only=True,
    ),
    noise=(0.005**2, 0.005**2),  # with the effect of the load transfer, where it is not identified
    discrepancy=0.0014,
    large_offset=True,
    of_roll=True,
    model=SensorModel(
        value=lambda now, i, name: now.wheel_speed_difference(i, name),
        rate=lambda now, _, value: now.rate_of(value),
        sensitivities={"load_sensitivity": lambda now, i, name: now.load_transfer_of_axle(i, name)},
        needs_track=True,
        needs_roll=True,
    ),
    errors=(
        ErrorKind(kind="offset", prior=0.005, per_log=True, gross=0.02),
        GAIN(prior=0.03),
        # Magic Formula files of two truck tyres give 0.001 and 0.017 for a laden trailer axle
        ErrorKind(kind="load_sensitivity", unit="1", prior=0.015),
        # the control unit averages pulses over 20 to 60 ms, and a wheel follows the road within a relaxation length
        DELAY(prior=0.05),
    ),
)
"""Speed of the right wheel of an axle less that of the left one, divided by their mean: wheel_speed_difference.<unit>
or .<unit>.<axle>.

In a left turn it is positive. Its offset is the relative difference of the rolling radii of both sides, its gain the
track of the axle over that of the vehicle. Its load sensitivity is its change with the load transfer ratio: the wheel
with more load has a smaller rolling radius (H. B. Pacejka, Tyre and Vehicle Dynamics, 2006; `MagicFormula` of `plant`).
"""
