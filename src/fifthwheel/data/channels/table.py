"""The table of what sensors measure, with their errors: a `Channel` for each quantity, by the kind of motion."""

import math
from dataclasses import replace

import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.data.channels.channel import (
    DEGREES,
    DELAY,
    GAIN,
    Channel,
    ErrorKind,
    Exchange,
    GainFault,
    Instant,
    NamePattern,
    SensorModel,
    SignalLimits,
    StateNoise,
    Symbol,
    Turn,
    TurnRelation,
    named,
)

UNDERSTEER = 0.004
"""s^2/m; understeer gradient of a heavy truck; measured values lie between 0.002 and 0.008."""
VELOCITY_WORDS = "_vel[a-z]*(_hor|_body)?"
EARTH_FIXED = "ecef|xyz|_(ned|enu|utm)_"
"""Words for axes that do not turn with the vehicle."""

SPEED = Channel(
    quantity="speed",
    unit="m/s",
    of="vehicle",
    patterns=named(
        "(vehicle|_veh|_car|ground|gps|gnss)_?(speed|spd|vel)"
        "|_(speed|velocity|spd|vel|geschw(indigkeit)?|vitesse)(_?[23]d)?_$|(fahr|fahrzeug|fzg)_?geschw"
        "|_vitesse_(veh|gps|sol|long)|_speedo|_vgps_|_geschw_(szm|zm|lkw|fzg)_"
        f"|long(itudinal)?_?vel|{VELOCITY_WORDS}_(forwards?|x)_|_(forwards?|x)_?vel"
        "|_v_?(x|ist|fzg|veh|ego|long|signal)?_$|_tacho_|_v_?x_(vehicle|veh|car|ego|cog)",
        excluded="_lat(eral)?_|_side|_vert|_north|_east|_down|_up_|_[yz]_|_ang|_rot|yaw|gier|roll|wank|pitch|nick"
        "|steer|lenk|_eng(ine)?_|_motor_|shaft|_fan_|_pump_|turbo|_wind_|cruise|_gear|frame|quer|laterale"
        f"|lacet|roulis|tangage|volant|braquage|roue|moteur|_(lrw|lw|swa|hwa)_|{EARTH_FIXED}",
    ),
    proposed="signal",
    limit=SignalLimits(magnitude=45.0, jump=2.0, may_be_constant=True),
    errors=(DELAY(prior=0.1),),  # a CAN bus gives the speed of the truck 50 to 150 ms late
)

STEER = Channel(
    quantity="steer",
    unit="rad",
    of="part",
    patterns=named(
        "steer|lenk(rad)?_?w|_lenk(ung|rad)?_$|(road|front)_?wheel_?ang|rad_?einschlag|volant|braquage"
        "|hand_?(wheel|whl)|_str?g?_?(wheel|whl)_?(ang|pos)|_(swa|lrw|lw|hwa)_|_sw_?(ang|pos)"
        "|_(sas|lws|lwi)_(.*_)?(ang|winkel)|_delta(_(front|vorne?|f|fl|fr|l|r|h|sw|1))?_$",
        excluded="_[lr]_?[2-9]_",
    ),
    proposed="signal",
    limit=SignalLimits(magnitude=1.2, jump=0.08, turn=0.01),
    turn=TurnRelation(
        expected=lambda turn: turn.yaw_rate * (turn.wheelbase + UNDERSTEER * turn.speed**2) / turn.speed,
        least_sigma=0.003,
        gain_faults=(
            GainFault("steering wheel", 7, 38),
            GainFault("steering wheel", 300, np.inf),
            *DEGREES,
            GainFault("gain", -1, 0.35, if_excited=True),
            GainFault("gain", 2.2, np.inf, if_excited=True),
        ),
        largest_offset=0.02,
        lag=0.25,
        part="front",
    ),
    errors=(
        ErrorKind(kind="offset", prior=0.01, per_log=True, gross=0.04, weight=1.5),
        GAIN(prior=0.15),  # a nominal steering ratio may be wrong by this
        DELAY(prior=0.05, linear=False),
        ErrorKind(kind="play", unit="rad", prior=math.radians(0.2), positive=True, linear=False),  # of a sound steering
    ),
    true_value=lambda measured, error: error["gain"] * (measured - error["offset"]),
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
        NamePattern("yaw_?(rate|vel)|gier_?(rate|geschw|winkelgeschw)|_psi_?(p|dot)_|(vitesse|taux)_(de_)?lacet"),
        NamePattern(f"gyr[a-z]*?_?z_|_(gz|wz|avz|omega_?z)_|_{AXIS_WORDS}_(z|down|up)_|_rate_(body|hor)_z_"),
        NamePattern("_(yaw|gier|lacet|psi)_", excluded="_[alr]\\d_", generic=True),
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
    exchange=Exchange(margin=0.1, least_explained=0.8),
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
    patterns=named("articulat|hitch|knick|attelage|coupling_angle|_gamma_|_art_h_"),
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


ROLLING = TurnRelation(
    expected=_in_turn, least_sigma=0.003, gain_faults=(GainFault("degrees", 20, np.inf),), has_other_causes=True
)
ROLL_RATE = Channel(
    quantity="roll_rate",
    of_roll=True,
    unit="rad/s",
    patterns=(
        NamePattern("roll_?(rate|vel)|wank_?(rate|geschw|winkelgeschw)|_phi_?(p|dot)_|(vitesse|taux)_(de_)?roulis"),
        NamePattern(f"gyr[a-z]*?_?x_|_(gx|wx|avx|omega_?x)_|_{AXIS_WORDS}_(x|forward)_|_rate_(body|hor)_x_"),
        NamePattern("_(roll|wank|roulis|phi)_", excluded="_[alr]\\d_", generic=True),
    ),
    proposed="signal",
    limit=SignalLimits(magnitude=2.0, jump=0.4),
    turn=ROLLING,
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
        NamePattern("_roll(_?angle)?_|wank_?winkel|_phi_|angle_(de_)?roulis", excluded="_[alr]\\d_"),
        NamePattern("_(wank|roulis)_", generic=True),
    ),
    proposed="signal",
    limit=SignalLimits(magnitude=0.5, jump=0.05, turn=0.02),
    turn=replace(ROLLING, derivative=True),
    noise=(0.005**2, 0.005**2),
    state=StateNoise(process=3e-5**2, observer_process=1e-3**2, initial_sigma=0.005),
    model=SensorModel(value=lambda now, i, _: now.motion.roll[i], needs_roll=True),
)


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
    patterns=named(
        f"lat(eral)?_?acc|{ACCELERATION_WORDS}_?(y|lat[a-z]*)_?\\d?_|_a_?y(_|\\d)|_y_?acc|quer_?beschl|acc[a-z]*_transv",
        excluded="_ang",
    ),
    proposed="signal",
    limit=SignalLimits(magnitude=12.0, jump=3.0, turn=1.0),
    turn=TurnRelation(
        expected=lambda turn: turn.speed * turn.unit_yaw_rate,
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
    patterns=named(
        f"lat(eral)?_?vel|{VELOCITY_WORDS}_(y|lat[a-z]*|side[a-z]*)_|_y_?vel|_v_?y_|quer_?geschw",
        excluded=f"_ang|frame|{EARTH_FIXED}",
    ),
    proposed="reference",
    limit=SignalLimits(magnitude=10.0, jump=1.0),
    state=StateNoise(process=3e-3**2, observer_process=2e-2**2, initial_sigma=0.05),
    model=SensorModel(value=_lateral_velocity, has_place=True),
)

SIDESLIP = Channel(
    quantity="sideslip",
    unit="rad",
    patterns=named(
        "side_?slip|slip_?angle|angle_?slip|schwimm|_beta_|angle_(de_)?derive",
        excluded="_(front|rear|left|right)_|rate",
    ),
    proposed="reference",
    limit=SignalLimits(magnitude=1.0, jump=0.1),
    noise=(0.005**2, 0.005**2),
    model=SensorModel(value=lambda now, i, name: _lateral_velocity(now, i, name) / now.motion.u[i], has_place=True),
)


_HALF_TRACK = 1.0
"""m, typical."""

WHEEL_SPEED = Channel(
    quantity="wheel_speed",
    unit="m/s",
    of="part",
    patterns=named(
        "(wheel|whl|axle)_?(speed|spd)|rad_?geschw|_v_rad|_spd_fa_|vitesse_(de_)?roue"
        "|_(v|vel|spd|speed)_?(fl|fr|rl|rr|vl|vr|hl|hr)_",
        excluded="steer|lenk|_ang|_rot",
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


AXLE_LOAD = Channel(
    quantity="axle_load",
    unit="N",
    of="part",
    patterns=named("axle_(weight|load)|achslast|powered_vehicle_weight"),
    proposed="signal",
    limit=SignalLimits(magnitude=5e5, jump=1e5, may_be_constant=True),
    scale=0.02,
)
"""Of an axle group; without a part, of all axles of the unit. TRL report RR103: of three commercial systems none is
always within 2 %."""
WEIGHT = Channel(
    quantity="weight",
    unit="N",
    patterns=named("trailer_weight|anhaenger_?gewicht"),
    proposed="signal",
    limit=SignalLimits(magnitude=1e6, jump=1e5, may_be_constant=True),
    scale=0.02,
)
"""Of a unit with its load, on axles and coupling."""
GROSS_WEIGHT = Channel(
    quantity="gross_weight",
    unit="N",
    of="vehicle",
    patterns=named("gross_(combination_)?(vehicle_)?weight|gesamt_?gewicht"),
    proposed="signal",
    limit=SignalLimits(magnitude=5e6, jump=1e6, may_be_constant=True),
    scale=0.05,
)
"""Of the whole vehicle. Many control units compute it from driving; that is within 5 % (Vahidi et al. 2005)."""
WEIGHTS = (AXLE_LOAD, WEIGHT, GROSS_WEIGHT)
"""Those from which masses follow."""


ENGINE_SPEED = Channel(
    quantity="engine_speed",
    unit="rad/s",
    of="vehicle",
    patterns=named(
        "engine_?(speed|spd|rpm)|_eng_?(spd|rpm|speed)_|motor_?drehzahl|regime_moteur|_rpm_",
        excluded="wheel|whl|axle|shaft|turbo|fan|pump|retarder|at_(point|idle)",
    ),
    proposed="signal",
)
ENGINE_TORQUE = Channel(
    quantity="engine_torque",
    unit="N m",
    of="vehicle",
    patterns=named(
        "(engine|_eng_|_mot(or)?_?).*(torque|trq|moment)|couple_moteur",
        excluded="friction|reib|loss|driver|max|reference|_ref_|parasitic|retarder|steer|lenk",
        own="torque|trq|moment|couple",
    ),
    proposed="signal",
    percent="reference",
)
"""At the crankshaft; where the log has `FRICTION_TORQUE`, with the torque that friction takes."""
FRICTION_TORQUE = Channel(
    quantity="friction_torque",
    unit="N m",
    of="vehicle",
    patterns=named("(friction|reib).*(torque|trq|moment)", own="torque|trq|moment", excluded="brake|clutch"),
    proposed="signal",
    percent="reference",
)
"""Of the engine, positive."""
DRIVE_FORCE = Channel(
    quantity="drive_force",
    unit="N",
    of="vehicle",
    patterns=named("(drive|driving|traction|tractive)_?force|antriebs_?kraft|zug_?kraft", own="force"),
    proposed="signal",
)
"""Of all driven wheels on the road, positive forward."""
DRIVELINE_ENGAGED = Channel(
    quantity="driveline_engaged",
    unit="1",
    of="vehicle",
    patterns=named("(driveline|power_?train|antriebs_?strang)_?(engaged|closed|geschlossen)"),
    proposed="signal",
)
"""1 where the engine is connected to the wheels, 0 where clutch or gearbox are open."""
BRAKING = Channel(
    quantity="braking",
    unit="1",
    patterns=(
        NamePattern(
            "(retarder|intarder|engine_brake|motor_?bremse).*(torque|trq|moment|active)",
            excluded="reference|driver|max",
            own="torque|trq|moment|active",
            part="retarder",
        ),
        NamePattern(
            "brak(e|ing)_?(switch|active|lamp|light)|_braking_|brems_?(licht|schalter)|_bls_",
            excluded="park|hand|engine",
            own="switch|active|lamp",
        ),
    ),
    proposed="signal",
    percent="fraction",
)
"""Other than 0 where a brake of the unit acts: service brake, retarder or engine brake, each a signal if necessary."""
GRADE = Channel(
    quantity="grade",
    unit="1",
    of="vehicle",
    patterns=named("_(road_)?(grade|gradient|slope)_|strassen_?(neigung|steigung)|_steigung_"),
    proposed="signal",
    percent="fraction",
    limit=SignalLimits(magnitude=0.4, jump=0.1, may_be_constant=True),
)
"""Rise over run, positive uphill."""
DRIVING = (ENGINE_SPEED, ENGINE_TORQUE, FRICTION_TORQUE, DRIVE_FORCE, DRIVELINE_ENGAGED, BRAKING, GRADE)
"""Those that only the mass from driving, the grade and, of the brakes, who brakes use."""


STEER_RATE = Channel(
    quantity="steer_rate",
    unit="rad/s",
    of="part",
    patterns=named("(steer|lenk|_(swa|lrw|lw|hwa)_).*(rate|geschw|vel|speed)|vitesse.*(volant|braquage)"),
)
ARTICULATION_RATE = Channel(
    quantity="articulation_rate",
    unit="rad/s",
    patterns=named("(articulat|hitch|knick).*(rate|vel|geschw)|_art_?r_h_|vitesse.*(articulat|attelage)"),
)
YAW_ACCELERATION = Channel(quantity="yaw_acceleration", unit="rad/s^2", patterns=named("yaw_?acc|gier_?beschl"))
PITCH_RATE = Channel(
    quantity="pitch_rate",
    unit="rad/s",
    patterns=(
        NamePattern(
            "pitch_?(rate|vel)|nick_?(rate|geschw)|vitesse_(de_)?tangage|gyr[a-z]*?_?y_|_(gy|wy|avy|omega_?y)_"
        ),
        NamePattern(f"_{AXIS_WORDS}_(y|lat[a-z]*)_|_rate_(body|hor)_y_"),
    ),
)
LONGITUDINAL_ACCELERATION = Channel(
    quantity="longitudinal_acceleration",
    unit="m/s^2",
    patterns=(
        NamePattern(
            f"long(itudinal)?_?acc|{ACCELERATION_WORDS}_?(x|long[a-z]*|forward)_?\\d?_|_a_?x(_|\\d)", excluded="_ang"
        ),
        NamePattern("_x_?acc|laengs_?beschl", excluded="_ang"),
    ),
    limit=SignalLimits(magnitude=12.0, jump=3.0),
)
VERTICAL_ACCELERATION = Channel(
    quantity="vertical_acceleration",
    unit="m/s^2",
    patterns=named(
        f"vert(ical)?_?acc|{ACCELERATION_WORDS}_?(z|vert[a-z]*|down)_?\\d?_|_a_?z(_|\\d)|_z_?acc", excluded="_ang"
    ),
)
PITCH = Channel(quantity="pitch", unit="rad", patterns=named("_pitch(_?angle)?_|nick_?winkel|_theta_|tangage"))
YAW = Channel(quantity="yaw", unit="rad", patterns=named("_(yaw|heading|psi)(_?angle)?_|gier_?winkel|_lacet_"))
SLIP_ANGLE = Channel(
    quantity="slip_angle",
    unit="rad",
    of="part",
    state=StateNoise(process=0.0, observer_process=0.0, initial_sigma=0.002),
)
BANK = Channel(
    quantity="bank", unit="rad", state=StateNoise(process=2e-3**2, observer_process=2e-3**2, initial_sigma=0.03)
)
COUPLING_FORCE = Channel(
    quantity="coupling_force",
    unit="N",
    model=SensorModel(value=lambda now, i, _: now.coupling_force(i), behind_coupling=True),
)
HORIZON = 0.6
"""Of a predicted load transfer ratio, s. A warning then comes at least 0.5 s before a wheel lifts, in nearly all
manoeuvres; a longer one warns of more manoeuvres in which no wheel lifts."""


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
    model=SensorModel(
        value=lambda now, _, name: now.ahead(now.load_transfer(name), HORIZON), needs_track=True, needs_roll=True
    ),
)
"""The ratio after `HORIZON`, if steer angles and speed stay as they are."""
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

ALL = (
    *(*WEIGHTS, WHEEL_SPEED_DIFFERENCE, WHEEL_SPEED, SPEED, STEER_RATE, STEER, ARTICULATION_RATE, ARTICULATION),
    *(YAW_ACCELERATION, YAW_RATE),
    *(ROLL_RATE, PITCH_RATE, LATERAL_ACCELERATION, LONGITUDINAL_ACCELERATION, VERTICAL_ACCELERATION),
    *(LATERAL_VELOCITY, SIDESLIP, ROLL, PITCH, YAW, SLIP_ANGLE, BANK, COUPLING_FORCE),
    *(LOAD_TRANSFER, PREDICTED_LOAD_TRANSFER, *DRIVING, *COMPUTED),
)
"""In the order in which their patterns are compared with the name of a column: special ones first."""
