"""Lateral acceleration that an accelerometer on the sprung body measures."""

from fifthwheel.channels.channel import (
    Channel,
    ErrorKind,
    GainFault,
    Instant,
    NamePattern,
    SensorModel,
    SignalLimits,
    Symbol,
    TurnRelation,
)
from fifthwheel.units import STANDARD_GRAVITY as GRAVITY

ACCELERATION_WORDS = "acc(el|eleration)?(_hor|_body)?"


def _value(now: Instant, i: int, name: str) -> Symbol:
    """It contains g times the roll angle and the bank."""
    unit = now.vehicle.units[i].name
    arm = now.p[f"{name}.position"] - now.p[f"{unit}.cog"]
    above = now.p[f"{name}.height"] - now.p[f"{unit}.roll_axis_height"]
    a = now.acceleration[i]
    planar = a[0] + arm * a[1] + GRAVITY * now.motion.bank
    return planar - above * a[2] + GRAVITY * now.motion.roll[i] if now.roll else planar


LATERAL_ACCELERATION = Channel(
    quantity="lateral_acceleration",
    unit="m/s^2",
    patterns=(
        NamePattern(
            pattern=f"lat(eral)?_?acc|{ACCELERATION_WORDS}_?(y|lat[a-z]*)_?\\d?_|_a_?y(_|\\d)|_y_?acc|quer_?beschl",
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
    model=SensorModel(value=_value, has_place=True, rate=lambda now, _, value: now.rate_of(value)),
    errors=(
        ErrorKind(kind="offset", setting="acceleration_offset", per_log=True),
        ErrorKind(kind="gain", setting="acceleration_gain"),
        ErrorKind(kind="delay", setting="acceleration_delay"),
        ErrorKind(kind="position", setting="accelerometer_position"),
        ErrorKind(kind="height", setting="accelerometer_height"),
    ),
)
