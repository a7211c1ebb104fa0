"""Lateral acceleration, as an accelerometer on the sprung body measures it; lateral velocity and sideslip angle."""

from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.data.channels.channel import (
    DELAY,
    GAIN,
    Channel,
    ErrorKind,
    GainFault,
    Instant,
    NamePattern,
    SensorModel,
    SignalLimits,
    StateNoise,
    Symbol,
    TurnRelation,
)
from fifthwheel.data.channels.inputs import EARTH_FIXED, VELOCITY_WORDS

ACCELERATION_WORDS = "acc(el|eleration)?(_hor|_body)?"


def _at_place(now: Instant, i: int, name: str, of_unit: Symbol) -> Symbol:
    """a + (x - x_cog) b - (h - h_r) c at the place, of (a, b[, c]) of the unit."""
    unit = now.vehicle.units[i].name
    arm = now.p[f"{name}.position"] - now.p[f"{unit}.cog"]
    above = now.p[f"{name}.height"] - now.p[f"{unit}.roll_axis_height"]
    return of_unit[0] + arm * of_unit[1] - (above * of_unit[2] if now.roll else 0)


def _acceleration(now: Instant, i: int, name: str) -> Symbol:
    """That of the place, with g times the roll angle and the bank."""
    return _at_place(now, i, name, now.acceleration[i]) + GRAVITY * now.motion.bank + GRAVITY * now.motion.roll[i]


LATERAL_ACCELERATION = Channel(
    quantity="lateral_acceleration",
    unit="m/s^2",
    patterns=(
        NamePattern(
            pattern=f"lat(eral)?_?acc|{ACCELERATION_WORDS}_?(y|lat[a-z]*)_?\\d?_|_a_?y(_|\\d)|_y_?acc|quer_?beschl|acc[a-z]*_transv",
            excluded="_ang",
        ),
    ),
    proposed="signal",
    limit=SignalLimits(magnitude=12.0, jump=3.0, turn=1.0),
    turn=TurnRelation(
        expected=lambda turn: turn.speed * turn.yaw_rate,
        least_sigma=0.3,
        gain_faults=(GainFault("degrees", -1, 1 / 20), GainFault("unit", -1, 0.4), GainFault("unit", 2.5, 5)),
        largest_offset=1.0,
    ),
    noise=(0.2**2, 0.2**2),
    model=SensorModel(value=_acceleration, has_place=True, rate=lambda now, _, value: now.rate_of(value)),
    large_offset=True,
    of_roll=True,
    errors=(
        ErrorKind(
            kind="offset", prior=0.3, per_log=True, gross=1.0, weight=0.5
        ),  # with gravity by the tilt: 1 degree gives 0.17 m/s^2
        GAIN(prior=0.03),
        DELAY(prior=0.03, linear=False),  # with that of the low-pass filter of the sensor
        ErrorKind(kind="position", unit="m", prior=0.5, gross=1.5, weight=0.5),
        ErrorKind(kind="height", unit="m", prior=0.3, gross=0.6, weight=0.5),
    ),
)


def _lateral_velocity(now: Instant, i: int, name: str) -> Symbol:
    return _at_place(now, i, name, now.motion.velocity[i])


LATERAL_VELOCITY = Channel(
    quantity="lateral_velocity",
    unit="m/s",
    patterns=(
        NamePattern(
            pattern=f"lat(eral)?_?vel|{VELOCITY_WORDS}_(y|lat[a-z]*|side[a-z]*)_|_y_?vel|_v_?y_|quer_?geschw",
            excluded=f"_ang|frame|{EARTH_FIXED}",
        ),
    ),
    proposed="reference",
    limit=SignalLimits(magnitude=10.0, jump=1.0),
    state=StateNoise(process=3e-3**2, observer_process=2e-2**2, initial_sigma=0.05),
    model=SensorModel(value=_lateral_velocity, has_place=True),
)

SIDESLIP = Channel(
    quantity="sideslip",
    unit="rad",
    patterns=(
        NamePattern(
            pattern="side_?slip|slip_?angle|angle_?slip|schwimm|_beta_|angle_(de_)?derive",
            excluded="_(front|rear|left|right)_|rate",
        ),
    ),
    proposed="reference",
    limit=SignalLimits(magnitude=1.0, jump=0.1),
    noise=(0.005**2, 0.005**2),
    model=SensorModel(
        value=lambda now, i, name: _lateral_velocity(now, i, name) / now.motion.u[i],
        has_place=True,
    ),
)
