"""Quantities of the longitudinal motion: force, engine, brakes and grade."""

from fifthwheel.channels.channel import Channel

ENGINE_SPEED = Channel(quantity="engine_speed", unit="rad/s", of="vehicle")
ENGINE_TORQUE = Channel(quantity="engine_torque", unit="N m", of="vehicle")
"""At the crankshaft; where the log has `FRICTION_TORQUE`, with the torque that friction takes."""
FRICTION_TORQUE = Channel(quantity="friction_torque", unit="N m", of="vehicle")
"""Of the engine, positive."""
DRIVE_FORCE = Channel(quantity="drive_force", unit="N", of="vehicle")
"""Of all driven wheels on the road, positive forward."""
DRIVELINE_ENGAGED = Channel(quantity="driveline_engaged", unit="1", of="vehicle")
"""1 where the engine is connected to the wheels, 0 where clutch or gearbox are open."""
BRAKING = Channel(quantity="braking", unit="1")
"""Other than 0 where a brake of the unit acts: service brake, retarder or engine brake, each a signal if necessary."""
GRADE = Channel(quantity="grade", unit="1", of="vehicle")
"""Rise over run, positive uphill."""
DRIVING = (ENGINE_SPEED, ENGINE_TORQUE, FRICTION_TORQUE, DRIVE_FORCE, DRIVELINE_ENGAGED, BRAKING, GRADE)
