"""Lateral velocity and sideslip angle of a unit at a place on it."""

from fifthwheel.channels.channel import Channel, Instant, NamePattern, SensorModel, SignalLimits, StateNoise, Symbol
from fifthwheel.channels.inputs import VELOCITY_WORDS


def _lateral_velocity(now: Instant, i: int, name: str) -> Symbol:
    """v + (x - x_cog) r - (h - h_r) p at the place."""
    unit = now.vehicle.units[i].name
    arm = now.p[f"{name}.position"] - now.p[f"{unit}.cog"]
    above = now.p[f"{name}.height"] - now.p[f"{unit}.roll_axis_height"]
    return now.motion.v[i] + arm * now.motion.r[i] - above * now.motion.roll_rate[i]


LATERAL_VELOCITY = Channel(
    quantity="lateral_velocity",
    unit="m/s",
    patterns=(
        NamePattern(
            pattern=f"lat(eral)?_?vel|{VELOCITY_WORDS}_(y|lat[a-z]*|side[a-z]*)_|_y_?vel|_v_?y_|quer_?geschw",
            excluded="_ang|frame",
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
            pattern="side_?slip|slip_?angle|angle_?slip|schwimm|_beta_", excluded="_(front|rear|left|right)_|rate"
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
