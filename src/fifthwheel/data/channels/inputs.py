"""The inputs of the model: speed of the vehicle, and angles of steered wheels."""

import math

import numpy as np

from fifthwheel.data.channels.channel import (
    DEGREES,
    DELAY,
    GAIN,
    Channel,
    ErrorKind,
    GainFault,
    NamePattern,
    SignalLimits,
    TurnRelation,
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
    patterns=(
        NamePattern(
            pattern="(vehicle|_veh|_car|ground|gps|gnss)_?(speed|spd|vel)"
            "|_(speed|velocity|spd|vel|geschw(indigkeit)?|vitesse)(_?[23]d)?_$|(fahr|fahrzeug|fzg)_?geschw"
            "|_vitesse_(veh|gps|sol|long)|_speedo|_vgps_|_geschw_(szm|zm|lkw|fzg)_"
            f"|long(itudinal)?_?vel|{VELOCITY_WORDS}_(forwards?|x)_|_(forwards?|x)_?vel"
            "|_v_?(x|ist|fzg|veh|ego|long|signal)?_$|_tacho_|_v_?x_(vehicle|veh|car|ego|cog)",
            excluded="_lat(eral)?_|_side|_vert|_north|_east|_down|_up_|_[yz]_|_ang|_rot|yaw|gier|roll|wank|pitch|nick"
            "|steer|lenk|_eng(ine)?_|_motor_|shaft|_fan_|_pump_|turbo|_wind_|cruise|_gear|frame|quer|laterale"
            f"|lacet|roulis|tangage|volant|braquage|roue|moteur|_(lrw|lw|swa|hwa)_|{EARTH_FIXED}",
        ),
    ),
    proposed="signal",
    limit=SignalLimits(magnitude=45.0, jump=2.0, may_be_constant=True),
    errors=(DELAY(prior=0.1),),  # a CAN bus gives the speed of the truck 50 to 150 ms late
)

STEER = Channel(
    quantity="steer",
    unit="rad",
    of="part",
    patterns=(
        NamePattern(
            pattern="steer|lenk(rad)?_?w|_lenk(ung|rad)?_$|(road|front)_?wheel_?ang|rad_?einschlag|volant|braquage"
            "|hand_?(wheel|whl)|_str?g?_?(wheel|whl)_?(ang|pos)|_(swa|lrw|lw|hwa)_|_sw_?(ang|pos)"
            "|_(sas|lws|lwi)_(.*_)?(ang|winkel)|_delta(_(front|vorne?|f|fl|fr|l|r|h|sw|1))?_$",
            excluded="_[lr]_?[2-9]_",
        ),
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
