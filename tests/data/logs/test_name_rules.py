"""Names of channels as databases, loggers and simulators write them, and the signals that they must be mapped to."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fifthwheel.base.units import factor
from fifthwheel.data.channels import SignalName, si_unit, split_header
from fifthwheel.data.logs.name_rules import classify_column, classify_columns, is_speed_by_unit, normalised_name

UNITS = ("tractor", "semitrailer")
STEER, SPEED = "steer.tractor.front", "speed"
YAW_RATE, ROLL_RATE, ROLL = "yaw_rate.tractor", "roll_rate.tractor", "roll.tractor"
LATERAL_ACCELERATION, LATERAL_VELOCITY, SIDESLIP = (
    f"{quantity}.tractor" for quantity in ("lateral_acceleration", "lateral_velocity", "sideslip")
)
TOWED_YAW_RATE, ARTICULATION = "yaw_rate.semitrailer", "articulation.semitrailer"

CHANNELS: dict[str, list[tuple[str, str | None, str | None]]] = {
    # J1939 data of California PATH trucks (j1939_struct.h and long_read_vehicle_state)
    "J1939, PATH": [
        ("VDC2_YawRate", "rad/s", YAW_RATE),
        ("VDC2_SteeringWheelAngle", "rad", STEER),
        ("VDC2_SteeringWheelTurnCounter", None, None),
        ("VDC2_LateralAcceleration", "m/s^2", LATERAL_ACCELERATION),
        ("VDC2_LongitudinalAcceleration", "m/s^2", None),
        ("CCVS_VehicleSpeed", None, SPEED),
        ("CCVS_CruiseControlSetSpeed", None, None),
        ("EBC2_FrontAxleSpeed", None, "wheel_speed.tractor.front"),
        ("HRW.front_axle_left_wheel_speed@0B", "km/h", "wheel_speed.tractor.front.left"),
        ("HRW.rear_axle_right_wheel_speed@0B", "km/h", "wheel_speed.tractor.rear.right"),
        ("HRW.front_axle_left_wheel_speed@C8", "km/h", "wheel_speed.semitrailer.front.left"),
        ("EBC2_RelativeSpeedFrontAxleLeftWheel", None, None),
        ("EBC2_RlativeSpeedFrontAxleRightWheel", None, None),
    ],
    # J1939 databases of trucks with Knorr-Bremse driver assistance (dataeval, signal groups of view scripts)
    "J1939, dataeval": [
        ("VDC2_YawRate_3E", None, YAW_RATE),
        ("VDC2_SteerWhlAngle_0B", "rad", STEER),
        ("VDC2_SteerWhlTurnCnt_0B", None, None),
        ("VDC2_LatAccel_3E", "m/s^2", LATERAL_ACCELERATION),
        ("EBC2_MeanSpdFA_0B", "km/h", "wheel_speed.tractor.front"),
        ("TCO1_VehSpd_EE", "km/h", SPEED),
        ("EEC1_EngSpd_00", "rpm", "engine_speed"),
        ("EEC2_AccPedalPos1_00", "%", None),
        ("TSRSpeedLimit", "km/h", None),
    ],
    # CSS Electronics: J1939 demo database and canmod-gps.dbc of the CANmod.gps and CANedge (api-examples)
    "CANedge": [
        ("WheelBasedVehicleSpeed", "km/h", SPEED),
        ("EngineSpeed", "rpm", "engine_speed"),
        ("EngineSpeed", None, "engine_speed"),
        ("Speed", "m/s", SPEED),
        ("SpeedAccuracy", "m/s", None),
        ("SpeedValid", None, None),
        ("Roll", "deg", ROLL),
        ("RollAccuracy", "deg", None),
        ("Heading", "deg", None),
        ("AccelerationY", "m/s^2", LATERAL_ACCELERATION),
        ("AccelerationZ", "m/s^2", None),
        ("AngularRateZ", "deg/s", YAW_RATE),
        ("AngularRateX", "deg/s", ROLL_RATE),
        ("AngularRateY", "deg/s", None),
    ],
    # Racelogic: VB20SL3.dbc, VBOX 3i user guide (CAN output), VBO file format
    "VBOX": [
        ("Velocity_Kmh", "Km/h", SPEED),
        ("Velocity_Kmh", None, SPEED),
        ("velocity kmh", None, SPEED),
        ("Trig_Vel_Kmh", None, None),
        ("Vertical_Velocity", "m/s", None),
        ("vert-vel", None, None),
        ("Lateral_vel", "Km/h", LATERAL_VELOCITY),
        ("X_velocity", None, SPEED),
        ("Y_velocity", None, LATERAL_VELOCITY),
        ("Yaw_rate", "deg/s", YAW_RATE),
        ("IMU_yaw_rate", "°/s", YAW_RATE),
        ("IMU_roll_rate", "°/s", ROLL_RATE),
        ("Lateral_acceleration", "G", LATERAL_ACCELERATION),
        ("Lat_acc", "g", LATERAL_ACCELERATION),
        ("Latacc", "g", LATERAL_ACCELERATION),
        ("Slip_angle", "deg", SIDESLIP),
        ("Slip_Angle_Front_Left", "°", None),
        ("Roll_angle", "deg", ROLL),
        ("True_heading", None, None),
    ],
    # OxTS: signals of the CAN messages 603h to 639h (RT user manual)
    "OxTS": [
        ("Speed2D", "m/s", SPEED),
        ("VelForward", "m/s", SPEED),
        ("VelLateral", "m/s", LATERAL_VELOCITY),
        ("VelNorth", "m/s", None),
        ("VelDown", "m/s", None),
        ("AccelY", "m/s²", LATERAL_ACCELERATION),
        ("AccelLateral", "m/s²", LATERAL_ACCELERATION),
        ("AccelSlip", "m/s²", None),
        ("AngleHeading", "°", None),
        ("AngleRoll", "°", ROLL),
        ("AngRateX", "°/s", ROLL_RATE),
        ("AngRateZ", "°/s", YAW_RATE),
        ("AngRateDown", "°/s", YAW_RATE),
        ("AngRateLateral", "°/s", None),
        ("AngAccelLateral", "°/s²", None),
        ("AngAccelLateral", None, None),
        ("AngleSlip", "°", SIDESLIP),
        ("IsoVsYawVelocity", "°/s", YAW_RATE),
        ("IsoVsYawAcceleration", "°/s²", None),
        ("IsoIsLongitudinalVelocity", "m/s", SPEED),
    ],
    # GeneSys ADMA: data channels of the protocol 3.3.4 (adma_ros_driver)
    "ADMA": [
        ("Rate_Hor_Z", "deg/s", YAW_RATE),
        ("Rate_Body_X", "deg/s", ROLL_RATE),
        ("Acc_Hor_Y", "g", LATERAL_ACCELERATION),
        ("Acc_Body_Y_POI2", "g", LATERAL_ACCELERATION),
        ("INS_Vel_Hor_X", "m/s", SPEED),
        ("INS_Vel_Hor_Y", "m/s", LATERAL_VELOCITY),
        ("INS_Vel_Frame_X", "m/s", None),
        ("GNSS_Vel_Latency", "s", None),
        ("GNSS_Stddev_Vel_X", "m/s", None),
        ("INS_Roll", "deg", ROLL),
        ("INS_Stddev_Roll", "deg", None),
        ("INS_Yaw", "deg", None),
        ("Side_Slip_Angle", "deg", SIDESLIP),
        ("Inv_Path_Radius", "1/m", None),
    ],
    # Kistler Correvit S-Motion: CAN messages 7E0h to 7E8h
    "Correvit": [
        ("vel", "km/h", SPEED),
        ("vel_x", "km/h", SPEED),
        ("vel_y_cor", "km/h", LATERAL_VELOCITY),
        ("ang_vel_z_hor", "deg/s", YAW_RATE),
        ("ang_vel_x_body", "deg/s", ROLL_RATE),
        ("acc_y_hor", "m/s^2", LATERAL_ACCELERATION),
        ("acc_c_body", "m/s^2", None),
        ("ang_vel_correction", None, None),
    ],
    # dSPACE ASM Vehicle Dynamics: headers of ControlDesk recordings, with "|" for "/"
    "dSPACE": [
        ("v_x_Vehicle_CoG[km|h]", None, SPEED),
        ("v_y_Vehicle_CoG[km|h]", None, LATERAL_VELOCITY),
        ("a_y_Vehicle_CoG[m|s2]", None, LATERAL_ACCELERATION),
        ("YawRate_Vehicle_CoG[deg|s]", None, YAW_RATE),
        ("Angle_Yaw_Vehicle_CoorSys_E[deg]", None, None),
        ("Pos_y_Vehicle_CoorSys_E[m]", None, None),
    ],
    # TruckSim: channels of a tractor-semitrailer run (LastRun.vs of TruckSim 2020.1; export of TahnT-Auburn/vehiclesim)
    "TruckSim": [
        ("Vx", "km/h", SPEED),
        ("Vy", "km/h", LATERAL_VELOCITY),
        ("VxTarget", "km/h", None),
        ("AVz", "deg/s", YAW_RATE),
        ("Ay", "g", LATERAL_ACCELERATION),
        ("Art_H", "deg", ARTICULATION),
        ("ArtR_H", "deg/s", None),
        ("Steer_SW", "deg", STEER),
        ("Steer_L1", "deg", STEER),
        ("Yaw", "deg", None),
        ("Roll_E", "deg", ROLL),
        ("Roll_A1", "deg", None),
    ],
    # Bosch: yaw-rate sensor MM5.10 (ABS M5 kit, CAN protocol); steering and ESP of VW MQB (opendbc, vw_mqb_2010.dbc)
    "Bosch": [
        ("Yaw_Rate", "°/s", YAW_RATE),
        ("AY1", "g", LATERAL_ACCELERATION),
        ("AX1", "g", None),
        ("Roll_Rate", "°/s", ROLL_RATE),
        ("LWI_Lenkradwinkel", "deg", STEER),
        ("LWI_VZ_Lenkradwinkel", None, None),
        ("LWI_QBit_Lenkradwinkel", None, None),
        ("ESP_v_Signal", "km/h", SPEED),
        ("ESP_QBit_v_Signal", None, None),
        ("ESP_Lenkeingriff_ADS", None, None),
    ],
    # Xsens: exports of MT Manager
    "Xsens": [
        ("Gyr_Z", "rad/s", YAW_RATE),
        ("Gyr_X", None, ROLL_RATE),
        ("Acc_Y", "m/s^2", LATERAL_ACCELERATION),
        ("VelInc_X", "m/s", None),
        ("Yaw", "deg", None),
    ],
    # Vector: vehicle.dbc of the CANoe demonstration; Toyota of opendbc (_toyota_2017.dbc)
    "databases of cars": [
        ("CarSpeed", "km/h", SPEED),
        ("EngSpeed", "rpm", "engine_speed"),
        ("EngSpeed", None, "engine_speed"),
        ("YAW_RATE", "deg/s", YAW_RATE),
        ("STEER_ANGLE", "deg", STEER),
        ("STEER_FRACTION", "deg", None),
        ("STEER_RATE", "deg/s", None),
        ("STEERING_TORQUE", None, None),
        ("WHEEL_SPEED_FL", "km/h", "wheel_speed.tractor.front.left"),
        ("ACCEL_Y", "m/s^2", LATERAL_ACCELERATION),
    ],
    # Dewesoft: Example_Drive01.d7d of dwdatareader
    "Dewesoft": [
        ("GPSvel", "km/h", SPEED),
        ("ENG_RPM", "rpm", "engine_speed"),
    ],
    # Tests of articulated vehicles with devices on both units
    "articulated vehicles": [
        ("TrlIMU_GyrZ", "deg/s", TOWED_YAW_RATE),
        ("YAW", "deg/s", YAW_RATE),
        ("YAW", "deg", None),
        ("YAW", None, None),
        ("YAW_TRL", "deg/s", TOWED_YAW_RATE),
        ("YAW_TRL", "deg", None),
        ("TrailerYawRate", "rad/s", TOWED_YAW_RATE),
        ("Gyro_Z_2", "deg/s", TOWED_YAW_RATE),
        ("articulationAngle", "rad", ARTICULATION),
        ("RoadWheelAngle", "deg", STEER),
        ("SteeringWheelAngle", "deg", STEER),
    ],
    # German, French and abbreviated names of test trucks
    "abbreviations": [
        ("v_GPS", "km/h", SPEED),
        ("vGPS", None, SPEED),
        ("VGPS", None, SPEED),
        ("Speed_GPS", None, SPEED),
        ("Geschw", "km/h", SPEED),
        ("Geschw_GPS", None, SPEED),
        ("speedo_obd", None, SPEED),
        ("vitesse", "km/h", SPEED),
        ("vitesse véhicule", None, SPEED),
        ("Quer_Geschw", "m/s", LATERAL_VELOCITY),
        ("VelRR_obd", None, "wheel_speed.tractor.rear.right"),
        ("vitesse_roue", None, "wheel_speed.tractor"),
        ("LRW", "deg", STEER),
        ("HWA", None, STEER),
        ("StWhlAng", "deg", STEER),
        ("SW_pos_obd", None, STEER),
        ("angle_volant", "deg", STEER),
        ("LRW_Geschw", "deg/s", None),
        ("LRW_Geschw", None, None),
        ("couple_volant", None, None),
        ("GierSA", "deg/s", TOWED_YAW_RATE),
        ("Gierrate Sattelauflieger", None, TOWED_YAW_RATE),
        ("vitesse_lacet", "deg/s", YAW_RATE),
        ("lacet_remorque", "deg/s", TOWED_YAW_RATE),
        ("lacet", None, None),
        ("psi", "deg/s", YAW_RATE),
        ("psi", "deg", None),
        ("phi", "deg/s", ROLL_RATE),
        ("phi", "deg", ROLL),
        ("WankSA", "deg/s", "roll_rate.semitrailer"),
        ("WankSA", "deg", "roll.semitrailer"),
        ("vitesse_roulis", None, ROLL_RATE),
        ("angle_attelage", "deg", ARTICULATION),
        ("acceleration_laterale", "m/s^2", LATERAL_ACCELERATION),
        ("angle_de_dérive", "deg", SIDESLIP),
    ],
    # Velocities on axes of the earth
    "earth": [
        ("ecef_vy", "m/s", None),
        ("ECEF_vel_x", "m/s", None),
        ("ECEF_vel_y", "m/s", None),
        ("bestxyz.vel_y", None, None),
        ("vel_y_ned", "m/s", None),
    ],
    # Constructed contradictions of unit, name and quantity
    "contradictions": [
        ("Speed", "rad/s", None),
        ("AngularVelocity", None, None),
        ("WheelSpeed", "rpm", None),
        ("SteeringWheelSpeed", "deg/s", None),
        ("SteeringWheelSpeed", None, None),
        ("YawRate", "V", None),
        ("YawRate", "deg/s^2", None),
        ("SteeringAngle", "%", None),
        ("WheelSlip_FL", "%", None),
        ("WindSpeed", "m/s", None),
        ("delta_t", "s", None),
        ("deltaQ", None, None),
    ],
    # J1939-71, the package's own database, and names of ours
    "driving": [
        ("EEC1.actual_engine_percent_torque", "%", "engine_torque"),
        ("EEC1_DriversDemandEnginePercentTorque", "%", None),
        ("EngineReferenceTorque", "N m", None),
        ("EEC3.nominal_friction_percent_torque", "%", "friction_torque"),
        ("ETC1.driveline_engaged", None, "driveline_engaged"),
        ("CCVS.brake_switch", None, "braking.tractor"),
        ("CCVS.parking_brake_switch", None, None),
        ("EBC1.asr_brake_control_active", None, None),
        ("ERC1.actual_retarder_percent_torque", "%", "braking.tractor.retarder"),
        ("Motordrehzahl", "1/min", "engine_speed"),
        ("wheel_rpm", "rpm", None),
        ("Motormoment", "Nm", "engine_torque"),
        ("Couple_moteur", "N m", "engine_torque"),
        ("steering_motor_torque", "Nm", None),
        ("engine_torque_mode", None, None),
        ("Bremslicht", None, "braking.tractor"),
        ("brake_pressure", "bar", None),
        ("road_grade", "%", "grade"),
    ],
}
TABLE = [(group, *channel) for group, channels in CHANNELS.items() for channel in channels]


def signal_of(column, unit):
    name, header_unit = split_header(column)
    hint = classify_column(name, unit or header_unit)
    return None if hint is None else hint.signal(UNITS)


@pytest.mark.parametrize(
    ("column", "unit", "signal"), [row[1:] for row in TABLE], ids=[f"{g}: {c} [{u}]" for g, c, u, _ in TABLE]
)
def test_a_channel_is_mapped_to_its_signal(column, unit, signal):
    assert signal_of(column, unit) == signal
    assert signal is None or si_unit(signal) is not None


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
        ("IMU2_GyroZ", "deg/s", "yaw_rate", True),
        ("gyroX", None, "roll_rate", None),
        ("Wankrate", "°/s", "roll_rate", None),
        ("VDC2.steering_wheel_angle@0B", "rad", "steer", None),
        ("VDC2.lateral_acceleration@0B", "m/s^2", "lateral_acceleration", None),
        ("EBS21.lateral_acceleration@C8", "m/s^2", "lateral_acceleration", True),
        ("HRW.front_axle_left_wheel_speed@0B", "km/h", "wheel_speed", None),
        ("HRW.front_axle_left_wheel_speed@C8", "km/h", "wheel_speed", True),
        ("delta_front", "deg", "steer", None),
        ("Lenkwinkelgeschwindigkeit", "°/s", "steer_rate", None),
        ("hitch", None, "articulation", None),
        ("hitch_rate", None, "articulation_rate", None),
        ("Querbeschleunigung", "m/s^2", "lateral_acceleration", None),
        ("ay1", "g", "lateral_acceleration", False),
        ("vy", "m/s", "lateral_velocity", None),
        ("beta", "deg", "sideslip", None),
        ("VW.axle_weight_1@EE", "kg", "axle_load", None),
        ("VW.axle_weight_2@EE", "kg", "axle_load", None),  # of the tractor, not of the second unit
        ("VW.trailer_weight@EE", "kg", "weight", True),
        ("CVW.gross_combination_vehicle_weight@EE", "kg", "gross_weight", None),
        ("CVW.powered_vehicle_weight@EE", "kg", "axle_load", None),
        ("v_kmh", None, "speed", None),
        ("LWI_Winkel_deg", None, "steer", None),
        ("yawTrl", "deg/s", "yaw_rate", True),
        ("GyroZ_Tr", "deg/s", "yaw_rate", None),
        ("RollRate@IMU_Trailer", "deg/s", "roll_rate", True),
        ("YawRate@0B", "rad/s", "yaw_rate", None),
    ],
)
def test_quantity_and_vehicle_unit_of_a_name(column, unit, quantity, trailing):
    hint = classify_column(column, unit)
    assert (hint.channel.quantity, hint.trailing) == (quantity, trailing)


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
def test_other_channels_have_no_hint(column, unit):
    assert classify_column(column, unit) is None


STEERING_WHEEL = "SteeringWheelAngle Lenkradwinkel Steer_SW VDC2_SteerWhlAngle_0B LRW HWA StWhlAng delta_LRW SW_pos_obd"
ROAD_WHEEL = "delta road_wheel_steer_angle RoadWheelAngle Steer_L1"


@pytest.mark.parametrize("name", [*STEERING_WHEEL.split(), "angle_volant", *ROAD_WHEEL.split()])
def test_angles_of_the_steering_wheel_and_of_the_road_wheels(name):
    assert classify_column(name, "deg").steering_wheel == (name not in ROAD_WHEEL.split())


@pytest.mark.parametrize(
    ("column", "unit", "low", "high", "expected"),
    [
        ("Kanal 7", "km/h", 0.0, 80.0, True),
        ("ch12", "mph", -0.1, 55.0, True),
        ("Kanal 7", "km/h", 0.0, 12.0, False),
        ("Kanal 7", "km/h", 0.0, 400.0, False),
        ("Kanal 7", "km/h", -80.0, 80.0, False),
        ("Kanal 7", "m/s", 0.0, 25.0, False),
        ("Kanal 7", None, 0.0, 80.0, False),
        ("Kanal 7", "deg", 0.0, 80.0, False),
        ("cruise_set", "km/h", 0.0, 80.0, False),
        ("wind", "km/h", 0.0, 80.0, False),
        ("north", "km/h", 0.0, 80.0, False),
    ],
)
def test_a_speed_by_its_unit_and_range(column, unit, low, high, expected):
    assert is_speed_by_unit(column, unit, low, high) == expected


def test_a_repeated_name_does_not_number_the_vehicle_unit():
    alone = classify_columns({"Gyro_Z_1": "deg/s", "Gyro_Z_2": "deg/s"})
    assert [hint.trailing for hint in alone.values()] == [False, True]
    repeated = classify_columns(
        {"Gyro_Z": "deg/s", "Gyro_Z_1": "deg/s", "tractor_gyro_z": None, "tractor_gyro_z_1": None}
    )
    assert [hint.trailing for hint in repeated.values()] == [None, None, False, False]


def test_the_unit_at_the_end_of_a_name():
    assert classify_column("v_kmh", None).unit == "km/h"
    assert classify_column("yaw_rate_deg_s", None).unit == "deg/s"
    assert classify_column("ay_mps2", None).unit == "m/s^2"
    assert classify_column("yaw_rate", "rad/s").unit is None


def test_names_are_divided_into_words():
    assert normalised_name("YawRate-Lkw (2)") == "yaw_rate_lkw_2"
    assert normalised_name("Gierwinkelgeschw. Äx") == "gierwinkelgeschw_aex"
    assert normalised_name("VDC2YawRate_3E") == "vdc2_yaw_rate_3e"
    assert normalised_name("TrlIMU_GyrZ") == "trl_imu_gyr_z"


WORDS = [
    "yaw", "Rate", "roll", "speed", "Vel", "gyro", "ang", "steer", "wheel", "lat", "acc", "x", "Y", "z", "1", "2", "trl"
]  # fmt: skip


@given(
    name=st.text(max_size=60) | st.lists(st.sampled_from(WORDS)).map("_".join),
    unit=st.none() | st.sampled_from(["m/s", "deg/s", "deg", "g", "kg", "raw", "%"]),
)
def test_any_name_gives_a_signal_with_a_fitting_unit_or_none(name, unit):
    signal = signal_of(name, unit)
    assert signal is None or si_unit(signal)
    assert signal is None or unit is None or factor(unit, si_unit(signal))
    assert signal is None or unit != "%"


def test_signals_of_a_single_unit_have_no_towed_unit():
    assert classify_column("hitch", None).signal(["tractor"]) == "articulation.tractor"
    assert {SignalName.of(signal).unit for *_, signal in TABLE if signal} == {"", *UNITS}


LONG = ("tractor", "first", "dolly", "second")


@pytest.mark.parametrize(
    ("column", "signal"),
    [
        ("Dolly yaw rate [deg/s]", "yaw_rate.dolly"),
        ("gz_first", "yaw_rate.first"),
        ("yaw_rate_3", "yaw_rate.dolly"),
        ("imu2_gyro_x", "roll_rate.first"),
        ("articulation_dolly", "articulation.dolly"),
        ("articulation_angle", "articulation.second"),
        ("trailer_yaw_rate", "yaw_rate.second"),
        ("tractor_ay", "lateral_acceleration.tractor"),
        ("yaw_rate", "yaw_rate.tractor"),
    ],
)
def test_columns_of_a_long_combination(column: str, signal: str) -> None:
    """By the name of the unit, else its number, else the last unit for a trailer."""
    hint = classify_column(column, None)
    assert hint is not None
    assert hint.signal(LONG) == signal


@pytest.mark.parametrize(
    ("column", "unit", "sensor"),
    [
        ("VDC2_YawRate_3E", None, "vdc2"),
        ("VDC2.yaw_rate@0B", "rad/s", "vdc2"),
        ("VDC2_LatAccel_3E", "m/s^2", "vdc2"),
        ("VDC2_SteeringWheelAngle", "rad", "steering wheel"),
        ("Lenkradwinkel", "°", "steering wheel"),
        ("RoadWheelAngle", "deg", ""),
        ("oxts/imu.angular_velocity.z", None, "ins"),
        ("INS_YawRate", "deg/s", "ins"),
        ("NovAtel.yaw_rate", "deg/s", "ins"),
        ("vectornav/imu.angular_velocity.x", None, "ins"),
        ("INS_Vel_Hor_X", "m/s", ""),
        ("INS_Roll", "deg", ""),
        ("IMU_yaw_rate", "°/s", ""),
        ("Gierrate", "°/s", ""),
    ],
)
def test_the_class_of_a_sensor_by_its_name(column: str, unit: str | None, sensor: str) -> None:
    hint = classify_column(column, unit)
    assert hint is not None
    assert hint.sensor == sensor
