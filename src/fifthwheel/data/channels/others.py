"""Quantities that logs and references have, and that estimators do not use as measurements."""

from fifthwheel.data.channels.channel import (
    Channel,
    Instant,
    NamePattern,
    SensorModel,
    SignalLimits,
    StateNoise,
    Symbol,
)
from fifthwheel.data.channels.lateral import ACCELERATION_WORDS
from fifthwheel.data.channels.rotation import AXIS_WORDS

STEER_RATE = Channel(
    quantity="steer_rate",
    unit="rad/s",
    of="part",
    patterns=(
        NamePattern(pattern="(steer|lenk|_(swa|lrw|lw|hwa)_).*(rate|geschw|vel|speed)|vitesse.*(volant|braquage)"),
    ),
)
ARTICULATION_RATE = Channel(
    quantity="articulation_rate",
    unit="rad/s",
    patterns=(
        NamePattern(pattern="(articulat|hitch|knick).*(rate|vel|geschw)|_art_?r_h_|vitesse.*(articulat|attelage)"),
    ),
)
YAW_ACCELERATION = Channel(
    quantity="yaw_acceleration", unit="rad/s^2", patterns=(NamePattern(pattern="yaw_?acc|gier_?beschl"),)
)
PITCH_RATE = Channel(
    quantity="pitch_rate",
    unit="rad/s",
    patterns=(
        NamePattern(
            pattern="pitch_?(rate|vel)|nick_?(rate|geschw)|vitesse_(de_)?tangage|gyr[a-z]*?_?y_|_(gy|wy|avy|omega_?y)_"
        ),
        NamePattern(pattern=f"_{AXIS_WORDS}_(y|lat[a-z]*)_|_rate_(body|hor)_y_"),
    ),
)
LONGITUDINAL_ACCELERATION = Channel(
    quantity="longitudinal_acceleration",
    unit="m/s^2",
    patterns=(
        NamePattern(
            pattern=f"long(itudinal)?_?acc|{ACCELERATION_WORDS}_?(x|long[a-z]*|forward)_?\\d?_|_a_?x(_|\\d)",
            excluded="_ang",
        ),
        NamePattern(pattern="_x_?acc|laengs_?beschl", excluded="_ang"),
    ),
    limit=SignalLimits(magnitude=12.0, jump=3.0),
)
VERTICAL_ACCELERATION = Channel(
    quantity="vertical_acceleration",
    unit="m/s^2",
    patterns=(
        NamePattern(
            pattern=f"vert(ical)?_?acc|{ACCELERATION_WORDS}_?(z|vert[a-z]*|down)_?\\d?_|_a_?z(_|\\d)|_z_?acc",
            excluded="_ang",
        ),
    ),
)
PITCH = Channel(
    quantity="pitch", unit="rad", patterns=(NamePattern(pattern="_pitch(_?angle)?_|nick_?winkel|_theta_|tangage"),)
)
YAW = Channel(
    quantity="yaw", unit="rad", patterns=(NamePattern(pattern="_(yaw|heading|psi)(_?angle)?_|gier_?winkel|_lacet_"),)
)
SLIP_ANGLE = Channel(
    quantity="slip_angle",
    unit="rad",
    of="part",
    state=StateNoise(process=0.0, observer_process=0.0, initial_sigma=0.002),
)
BANK = Channel(
    quantity="bank",
    unit="rad",
    state=StateNoise(process=2e-3**2, observer_process=2e-3**2, initial_sigma=0.03),
)
COUPLING_FORCE = Channel(
    quantity="coupling_force",
    unit="N",
    model=SensorModel(value=lambda now, i, _: now.coupling_force(i), behind_coupling=True),
)
HORIZON = 0.6
"""Of a predicted load transfer ratio, s. A warning then comes at least 0.5 s before a wheel lifts, in nearly all
manoeuvres; a longer one warns of more manoeuvres in which no wheel lifts."""


def _predicted(now: Instant, i: int, name: str) -> Symbol:
    """The ratio after `HORIZON`, if steer angles and speed stay as they are."""
    return now.ahead(now.load_transfer(name), HORIZON)


LOAD_TRANSFER = Channel(
    quantity="load_transfer",
    unit="1",
    of="part",
    model=SensorModel(value=lambda now, _, name: now.load_transfer(name), needs_track=True, needs_roll=True),
)
"""Of an axle group: the load of its right wheels less that of its left ones, divided by their sum."""
PREDICTED_LOAD_TRANSFER = Channel(
    quantity="predicted_load_transfer",
    unit="1",
    of="part",
    model=SensorModel(value=_predicted, needs_track=True, needs_roll=True),
)
COMPUTED = (
    Channel(quantity="time", unit="s", of="vehicle"),
    Channel(quantity="longitudinal_velocity", unit="m/s"),
    Channel(quantity="roll_acceleration", unit="rad/s^2"),
    Channel(quantity="sideslip_rate", unit="rad/s"),
    Channel(quantity="longitudinal_force", unit="N", of="part"),
    Channel(quantity="lateral_force", unit="N", of="part"),
    Channel(quantity="vertical_force", unit="N", of="part"),
    Channel(quantity="position_x", unit="m"),
    Channel(quantity="position_y", unit="m"),
    Channel(quantity="curvature", unit="1/m"),
    Channel(quantity="gear", unit="1", of="vehicle"),
    Channel(quantity="head_wind", unit="m/s", of="vehicle"),
)
"""Quantities that only simulations and references have."""
