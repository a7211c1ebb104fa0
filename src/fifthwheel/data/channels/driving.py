"""Quantities of the longitudinal motion: force, engine, brakes and grade. The gross mass follows from them."""

from fifthwheel.data.channels.channel import Channel, NamePattern, SignalLimits

ENGINE_SPEED = Channel(
    quantity="engine_speed",
    unit="rad/s",
    of="vehicle",
    patterns=(
        NamePattern(
            pattern="engine_?(speed|spd|rpm)|_eng_?(spd|rpm|speed)_|motor_?drehzahl|regime_moteur|_rpm_",
            excluded="wheel|whl|axle|shaft|turbo|fan|pump|retarder|at_(point|idle)",
        ),
    ),
    proposed="signal",
)
ENGINE_TORQUE = Channel(
    quantity="engine_torque",
    unit="N m",
    of="vehicle",
    patterns=(
        NamePattern(
            pattern="(engine|_eng_|_mot(or)?_?).*(torque|trq|moment)|couple_moteur",
            excluded="friction|reib|loss|driver|max|reference|_ref_|parasitic|retarder|steer|lenk",
            own="torque|trq|moment|couple",
        ),
    ),
    proposed="signal",
    percent="reference",
)
"""At the crankshaft; where the log has `FRICTION_TORQUE`, with the torque that friction takes."""
FRICTION_TORQUE = Channel(
    quantity="friction_torque",
    unit="N m",
    of="vehicle",
    patterns=(
        NamePattern(pattern="(friction|reib).*(torque|trq|moment)", own="torque|trq|moment", excluded="brake|clutch"),
    ),
    proposed="signal",
    percent="reference",
)
"""Of the engine, positive."""
DRIVE_FORCE = Channel(
    quantity="drive_force",
    unit="N",
    of="vehicle",
    patterns=(NamePattern(pattern="(drive|driving|traction|tractive)_?force|antriebs_?kraft|zug_?kraft", own="force"),),
    proposed="signal",
)
"""Of all driven wheels on the road, positive forward."""
DRIVELINE_ENGAGED = Channel(
    quantity="driveline_engaged",
    unit="1",
    of="vehicle",
    patterns=(NamePattern(pattern="(driveline|power_?train|antriebs_?strang)_?(engaged|closed|geschlossen)"),),
    proposed="signal",
)
"""1 where the engine is connected to the wheels, 0 where clutch or gearbox are open."""
BRAKING = Channel(
    quantity="braking",
    unit="1",
    patterns=(
        NamePattern(
            pattern="(retarder|intarder|engine_brake|motor_?bremse).*(torque|trq|moment|active)",
            excluded="reference|driver|max",
            own="torque|trq|moment|active",
            part="retarder",
        ),
        NamePattern(
            pattern="brak(e|ing)_?(switch|active|lamp|light)|_braking_|brems_?(licht|schalter)|_bls_",
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
    patterns=(NamePattern(pattern="_(road_)?(grade|gradient|slope)_|strassen_?(neigung|steigung)|_steigung_"),),
    proposed="signal",
    percent="fraction",
    limit=SignalLimits(magnitude=0.4, jump=0.1, may_be_constant=True),
)
"""Rise over run, positive uphill."""
DRIVING = (ENGINE_SPEED, ENGINE_TORQUE, FRICTION_TORQUE, DRIVE_FORCE, DRIVELINE_ENGAGED, BRAKING, GRADE)
"""Those that only the mass from driving, the grade and, of the brakes, who brakes use."""
