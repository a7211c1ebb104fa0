import pytest

from fifthwheel.logs.hints import hint, plain


@pytest.mark.parametrize(
    ("column", "unit", "quantity", "trailing"),
    [
        ("vx", None, "speed", None),
        ("CCVS.wheel_based_vehicle_speed@00", "km/h", "speed", None),
        ("Geschwindigkeit", "km/h", "speed", None),
        ("EBC2.front_axle_speed@0B", "km/h", "wheel_speed", None),
        ("VDC2.yaw_rate@0B", "rad/s", "yaw_rate", None),
        ("YawRate_Trailer", "deg/s", "yaw_rate", True),
        ("Gierrate Auflieger", "°/s", "yaw_rate", True),
        ("Gierrate Zugm.", "°/s", "yaw_rate", False),
        ("imu/angular_velocity.z", None, "yaw_rate", None),
        ("psi_dot_2", "rad/s", "yaw_rate", True),
        ("gyroX", None, "roll_rate", None),
        ("Wankrate", "°/s", "roll_rate", None),
        ("VDC2.steering_wheel_angle@0B", "rad", "steer", None),
        ("delta_front", "deg", "steer", None),
        ("Lenkwinkelgeschwindigkeit", "°/s", "steer_rate", None),
        ("hitch", None, "articulation", None),
        ("hitch_rate", None, "articulation_rate", None),
        ("Querbeschleunigung", "m/s^2", "lateral_acceleration", None),
        ("ay1", "g", "lateral_acceleration", False),
        ("vy", "m/s", "lateral_velocity", None),
        ("beta", "deg", "sideslip", None),
        ("VW.axle_weight_1@EE", "kg", "axle_load", False),
        ("v_kmh", None, "speed", None),
        ("LWI_Winkel_deg", None, "steer", None),
        ("yawTrl", "deg/s", "yaw_rate", True),
        ("GyroZ_Tr", "deg/s", "yaw_rate", None),
        ("RollRate@IMU_Trailer", "deg/s", "roll_rate", True),
        ("YawRate@0B", "rad/s", "yaw_rate", None),
    ],
)
def test_a_name_and_a_unit(column, unit, quantity, trailing):
    found = hint(column, unit)
    assert (found.quantity, found.trailing) == (quantity, trailing)


@pytest.mark.parametrize(
    ("column", "unit"),
    [
        ("engine_temp", "degC"),
        ("yaw_rate_status", None),
        ("VDC2.steering_wheel_turn_counter@0B", None),
        ("yaw_rate", "V"),
        ("EBC2.front_axle_left_relative_speed@0B", "km/h"),
        ("t", "s"),
    ],
)
def test_what_is_nothing_of_ours(column, unit):
    assert hint(column, unit) is None


def test_the_drivers_angle_is_told_from_that_of_the_wheels():
    assert hint("SteeringWheelAngle", "deg").steering_wheel
    assert hint("Lenkradwinkel", None).steering_wheel
    assert not hint("delta", None).steering_wheel
    assert not hint("road_wheel_steer_angle", None).steering_wheel


def test_a_unit_at_the_end_of_a_name():
    assert hint("v_kmh", None).unit == "km/h"
    assert hint("yaw_rate_deg_s", None).unit == "deg/s"
    assert hint("ay_mps2", None).unit == "m/s^2"
    assert hint("yaw_rate", "rad/s").unit is None


def test_names_become_words():
    assert plain("YawRate-Lkw (2)") == "yaw_rate_lkw_2"
    assert plain("Gierwinkelgeschw. Äx") == "gierwinkelgeschw_aex"
