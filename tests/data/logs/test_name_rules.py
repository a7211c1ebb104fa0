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

CHANNELS: dict[str, dict[str | None, str]] = {
    # J1939 data of California PATH trucks (j1939_struct.h and long_read_vehicle_state)
    "J1939, PATH": {
        YAW_RATE: "VDC2_YawRate [rad/s]",
        STEER: "VDC2_SteeringWheelAngle [rad]",
        LATERAL_ACCELERATION: "VDC2_LateralAcceleration [m/s^2]",
        SPEED: "CCVS_VehicleSpeed",
        "wheel_speed.tractor.front": "EBC2_FrontAxleSpeed",
        "wheel_speed.tractor.front.left": "HRW.front_axle_left_wheel_speed@0B [km/h]",
        "wheel_speed.tractor.rear.right": "HRW.rear_axle_right_wheel_speed@0B [km/h]",
        "wheel_speed.semitrailer.front.left": "HRW.front_axle_left_wheel_speed@C8 [km/h]",
        None: (
            "VDC2_SteeringWheelTurnCounter; VDC2_LongitudinalAcceleration [m/s^2]; CCVS_CruiseControlSetSpeed; "
            "EBC2_RelativeSpeedFrontAxleLeftWheel; EBC2_RlativeSpeedFrontAxleRightWheel"
        ),
    },
    # J1939 databases of trucks with Knorr-Bremse driver assistance (dataeval, signal groups of view scripts)
    "J1939, dataeval": {
        YAW_RATE: "VDC2_YawRate_3E",
        STEER: "VDC2_SteerWhlAngle_0B [rad]",
        LATERAL_ACCELERATION: "VDC2_LatAccel_3E [m/s^2]",
        "wheel_speed.tractor.front": "EBC2_MeanSpdFA_0B [km/h]",
        SPEED: "TCO1_VehSpd_EE [km/h]",
        "engine_speed": "EEC1_EngSpd_00 [rpm]",
        None: "VDC2_SteerWhlTurnCnt_0B; EEC2_AccPedalPos1_00 [%]; TSRSpeedLimit [km/h]",
    },
    # CSS Electronics: J1939 demo database and canmod-gps.dbc of the CANmod.gps and CANedge (api-examples)
    "CANedge": {
        SPEED: "WheelBasedVehicleSpeed [km/h]; Speed [m/s]",
        "engine_speed": "EngineSpeed [rpm]; EngineSpeed",
        ROLL: "Roll [deg]",
        LATERAL_ACCELERATION: "AccelerationY [m/s^2]",
        YAW_RATE: "AngularRateZ [deg/s]",
        ROLL_RATE: "AngularRateX [deg/s]",
        None: (
            "SpeedAccuracy [m/s]; SpeedValid; RollAccuracy [deg]; Heading [deg]; AccelerationZ [m/s^2]; "
            "AngularRateY [deg/s]"
        ),
    },
    # Racelogic: VB20SL3.dbc, VBOX 3i user guide (CAN output), VBO file format
    "VBOX": {
        SPEED: "Velocity_Kmh [Km/h]; Velocity_Kmh; velocity kmh; X_velocity",
        LATERAL_VELOCITY: "Lateral_vel [Km/h]; Y_velocity",
        YAW_RATE: "Yaw_rate [deg/s]; IMU_yaw_rate [°/s]",
        ROLL_RATE: "IMU_roll_rate [°/s]",
        LATERAL_ACCELERATION: "Lateral_acceleration [G]; Lat_acc [g]; Latacc [g]",
        SIDESLIP: "Slip_angle [deg]",
        ROLL: "Roll_angle [deg]",
        None: "Trig_Vel_Kmh; Vertical_Velocity [m/s]; vert-vel; Slip_Angle_Front_Left [°]; True_heading",
    },
    # OxTS: signals of the CAN messages 603h to 639h (RT user manual)
    "OxTS": {
        SPEED: "Speed2D [m/s]; VelForward [m/s]; IsoIsLongitudinalVelocity [m/s]",
        LATERAL_VELOCITY: "VelLateral [m/s]",
        LATERAL_ACCELERATION: "AccelY [m/s²]; AccelLateral [m/s²]",
        ROLL: "AngleRoll [°]",
        ROLL_RATE: "AngRateX [°/s]",
        YAW_RATE: "AngRateZ [°/s]; AngRateDown [°/s]; IsoVsYawVelocity [°/s]",
        SIDESLIP: "AngleSlip [°]",
        None: (
            "VelNorth [m/s]; VelDown [m/s]; AccelSlip [m/s²]; AngleHeading [°]; AngRateLateral [°/s]; "
            "AngAccelLateral [°/s²]; AngAccelLateral; IsoVsYawAcceleration [°/s²]"
        ),
    },
    # GeneSys ADMA: data channels of the protocol 3.3.4 (adma_ros_driver)
    "ADMA": {
        YAW_RATE: "Rate_Hor_Z [deg/s]",
        ROLL_RATE: "Rate_Body_X [deg/s]",
        LATERAL_ACCELERATION: "Acc_Hor_Y [g]; Acc_Body_Y_POI2 [g]",
        SPEED: "INS_Vel_Hor_X [m/s]",
        LATERAL_VELOCITY: "INS_Vel_Hor_Y [m/s]",
        ROLL: "INS_Roll [deg]",
        SIDESLIP: "Side_Slip_Angle [deg]",
        None: (
            "INS_Vel_Frame_X [m/s]; GNSS_Vel_Latency [s]; GNSS_Stddev_Vel_X [m/s]; INS_Stddev_Roll [deg]; "
            "INS_Yaw [deg]; Inv_Path_Radius [1/m]"
        ),
    },
    # Kistler Correvit S-Motion: CAN messages 7E0h to 7E8h
    "Correvit": {
        SPEED: "vel [km/h]; vel_x [km/h]",
        LATERAL_VELOCITY: "vel_y_cor [km/h]",
        YAW_RATE: "ang_vel_z_hor [deg/s]",
        ROLL_RATE: "ang_vel_x_body [deg/s]",
        LATERAL_ACCELERATION: "acc_y_hor [m/s^2]",
        None: "acc_c_body [m/s^2]; ang_vel_correction",
    },
    # dSPACE ASM Vehicle Dynamics: headers of ControlDesk recordings, with "|" for "/"
    "dSPACE": {
        SPEED: "v_x_Vehicle_CoG[km|h]",
        LATERAL_VELOCITY: "v_y_Vehicle_CoG[km|h]",
        LATERAL_ACCELERATION: "a_y_Vehicle_CoG[m|s2]",
        YAW_RATE: "YawRate_Vehicle_CoG[deg|s]",
        None: "Angle_Yaw_Vehicle_CoorSys_E[deg]; Pos_y_Vehicle_CoorSys_E[m]",
    },
    # TruckSim: channels of a tractor-semitrailer run (LastRun.vs of TruckSim 2020.1; export of TahnT-Auburn/vehiclesim)
    "TruckSim": {
        SPEED: "Vx [km/h]",
        LATERAL_VELOCITY: "Vy [km/h]",
        YAW_RATE: "AVz [deg/s]",
        LATERAL_ACCELERATION: "Ay [g]",
        ARTICULATION: "Art_H [deg]",
        STEER: "Steer_SW [deg]; Steer_L1 [deg]",
        ROLL: "Roll_E [deg]",
        None: "VxTarget [km/h]; ArtR_H [deg/s]; Yaw [deg]; Roll_A1 [deg]",
    },
    # Bosch: yaw-rate sensor MM5.10 (ABS M5 kit, CAN protocol); steering and ESP of VW MQB (opendbc, vw_mqb_2010.dbc)
    "Bosch": {
        YAW_RATE: "Yaw_Rate [°/s]",
        LATERAL_ACCELERATION: "AY1 [g]",
        ROLL_RATE: "Roll_Rate [°/s]",
        STEER: "LWI_Lenkradwinkel [deg]",
        SPEED: "ESP_v_Signal [km/h]",
        None: "AX1 [g]; LWI_VZ_Lenkradwinkel; LWI_QBit_Lenkradwinkel; ESP_QBit_v_Signal; ESP_Lenkeingriff_ADS",
    },
    # Xsens: exports of MT Manager
    "Xsens": {
        YAW_RATE: "Gyr_Z [rad/s]",
        ROLL_RATE: "Gyr_X",
        LATERAL_ACCELERATION: "Acc_Y [m/s^2]",
        None: "VelInc_X [m/s]; Yaw [deg]",
    },
    # Vector: vehicle.dbc of the CANoe demonstration; Toyota of opendbc (_toyota_2017.dbc)
    "databases of cars": {
        SPEED: "CarSpeed [km/h]",
        "engine_speed": "EngSpeed [rpm]; EngSpeed",
        YAW_RATE: "YAW_RATE [deg/s]",
        STEER: "STEER_ANGLE [deg]",
        "wheel_speed.tractor.front.left": "WHEEL_SPEED_FL [km/h]",
        LATERAL_ACCELERATION: "ACCEL_Y [m/s^2]",
        None: "STEER_FRACTION [deg]; STEER_RATE [deg/s]; STEERING_TORQUE",
    },
    # Dewesoft: Example_Drive01.d7d of dwdatareader
    "Dewesoft": {SPEED: "GPSvel [km/h]", "engine_speed": "ENG_RPM [rpm]"},
    # Tests of articulated vehicles with devices on both units
    "articulated vehicles": {
        TOWED_YAW_RATE: "TrlIMU_GyrZ [deg/s]; YAW_TRL [deg/s]; TrailerYawRate [rad/s]; Gyro_Z_2 [deg/s]",
        YAW_RATE: "YAW [deg/s]",
        ARTICULATION: "articulationAngle [rad]",
        STEER: "RoadWheelAngle [deg]; SteeringWheelAngle [deg]",
        None: "YAW [deg]; YAW; YAW_TRL [deg]",
    },
    # German, French and abbreviated names of test trucks
    "abbreviations": {
        SPEED: (
            "v_GPS [km/h]; vGPS; VGPS; Speed_GPS; Geschw [km/h]; Geschw_GPS; speedo_obd; vitesse [km/h]; "
            "vitesse véhicule"
        ),
        LATERAL_VELOCITY: "Quer_Geschw [m/s]",
        "wheel_speed.tractor.rear.right": "VelRR_obd",
        "wheel_speed.tractor": "vitesse_roue",
        STEER: "LRW [deg]; HWA; StWhlAng [deg]; SW_pos_obd; angle_volant [deg]",
        TOWED_YAW_RATE: "GierSA [deg/s]; Gierrate Sattelauflieger; lacet_remorque [deg/s]",
        YAW_RATE: "vitesse_lacet [deg/s]; psi [deg/s]",
        ROLL_RATE: "phi [deg/s]; vitesse_roulis",
        ROLL: "phi [deg]",
        "roll_rate.semitrailer": "WankSA [deg/s]",
        "roll.semitrailer": "WankSA [deg]",
        ARTICULATION: "angle_attelage [deg]",
        LATERAL_ACCELERATION: "acceleration_laterale [m/s^2]",
        SIDESLIP: "angle_de_dérive [deg]",
        None: "LRW_Geschw [deg/s]; LRW_Geschw; couple_volant; lacet; psi [deg]",
    },
    # Velocities on axes of the earth
    "earth": {None: "ecef_vy [m/s]; ECEF_vel_x [m/s]; ECEF_vel_y [m/s]; bestxyz.vel_y; vel_y_ned [m/s]"},
    # Constructed contradictions of unit, name and quantity
    "contradictions": {
        None: (
            "Speed [rad/s]; AngularVelocity; WheelSpeed [rpm]; SteeringWheelSpeed [deg/s]; SteeringWheelSpeed; "
            "YawRate [V]; YawRate [deg/s^2]; SteeringAngle [%]; WheelSlip_FL [%]; WindSpeed [m/s]; delta_t [s]; "
            "deltaQ"
        )
    },
    # J1939-71, the package's own database, and names of ours
    "driving": {
        "engine_torque": "EEC1.actual_engine_percent_torque [%]; Motormoment [Nm]; Couple_moteur [N m]",
        "friction_torque": "EEC3.nominal_friction_percent_torque [%]",
        "driveline_engaged": "ETC1.driveline_engaged",
        "braking.tractor": "CCVS.brake_switch; Bremslicht",
        "braking.tractor.retarder": "ERC1.actual_retarder_percent_torque [%]",
        "engine_speed": "Motordrehzahl [1/min]",
        "grade": "road_grade [%]",
        None: (
            "EEC1_DriversDemandEnginePercentTorque [%]; EngineReferenceTorque [N m]; CCVS.parking_brake_switch; "
            "EBC1.asr_brake_control_active; wheel_rpm [rpm]; steering_motor_torque [Nm]; engine_torque_mode; "
            "brake_pressure [bar]"
        ),
    },
}
"""By source and signal, names of columns with their units in brackets."""
TABLE = [
    (group, column, signal)
    for group, signals in CHANNELS.items()
    for signal, columns in signals.items()
    for column in columns.split("; ")
]


def hint_of(column, unit=None):
    name, header_unit = split_header(column)
    return classify_column(name, unit or header_unit)


def signal_of(column, unit=None):
    hint = hint_of(column, unit)
    return None if hint is None else hint.signal(UNITS)


@pytest.mark.parametrize(("column", "signal"), [row[1:] for row in TABLE], ids=[f"{g}: {c}" for g, c, _ in TABLE])
def test_a_channel_is_mapped_to_its_signal(column, signal):
    assert signal_of(column) == signal
    assert signal is None or si_unit(signal) is not None


QUANTITIES = {
    ("speed", None): "vx; CCVS.wheel_based_vehicle_speed@00 [km/h]; Geschwindigkeit [km/h]; v_kmh",
    ("wheel_speed", None): "EBC2.front_axle_speed@0B [km/h]; HRW.front_axle_left_wheel_speed@0B [km/h]",
    ("yaw_rate", None): "VDC2.yaw_rate@0B [rad/s]; imu/angular_velocity.z; GyroZ_Tr [deg/s]; YawRate@0B [rad/s]",
    ("yaw_rate", True): (
        "YawRate_Trailer [deg/s]; Gierrate Auflieger [°/s]; psi_dot_2 [rad/s]; IMU2_GyroZ [deg/s]; yawTrl [deg/s]"
    ),
    ("yaw_rate", False): "Gierrate Zugm. [°/s]",
    ("roll_rate", None): "gyroX; Wankrate [°/s]",
    ("steer", None): "VDC2.steering_wheel_angle@0B [rad]; delta_front [deg]; LWI_Winkel_deg",
    ("lateral_acceleration", None): "VDC2.lateral_acceleration@0B [m/s^2]; Querbeschleunigung [m/s^2]",
    ("lateral_acceleration", True): "EBS21.lateral_acceleration@C8 [m/s^2]",
    ("wheel_speed", True): "HRW.front_axle_left_wheel_speed@C8 [km/h]",
    ("steer_rate", None): "Lenkwinkelgeschwindigkeit [°/s]",
    ("articulation", None): "hitch",
    ("articulation_rate", None): "hitch_rate",
    ("lateral_acceleration", False): "ay1 [g]",
    ("lateral_velocity", None): "vy [m/s]",
    ("sideslip", None): "beta [deg]",
    ("axle_load", None): "VW.axle_weight_1@EE [kg]; VW.axle_weight_2@EE [kg]; CVW.powered_vehicle_weight@EE [kg]",
    ("weight", True): "VW.trailer_weight@EE [kg]",
    ("gross_weight", None): "CVW.gross_combination_vehicle_weight@EE [kg]",
    ("roll_rate", True): "RollRate@IMU_Trailer [deg/s]",
}
"""By quantity, and whether the name is that of a towed unit; axle_weight_2 is of the tractor."""


@pytest.mark.parametrize(("quantity", "trailing"), QUANTITIES)
def test_quantity_and_vehicle_unit_of_a_name(quantity, trailing):
    for column in QUANTITIES[quantity, trailing].split("; "):
        hint = hint_of(column)
        assert (hint.channel.quantity, hint.trailing) == (quantity, trailing), column


@pytest.mark.parametrize(
    "column",
    [
        *("engine_temp [degC]", "yaw_rate_status", "VDC2.steering_wheel_turn_counter@0B", "yaw_rate [V]", "t [s]"),
        "EBC2.front_axle_left_relative_speed@0B [km/h]",
    ],
)
def test_other_channels_have_no_hint(column):
    assert hint_of(column) is None


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


SENSORS = {
    "vdc2": "VDC2_YawRate_3E; VDC2.yaw_rate@0B [rad/s]; VDC2_LatAccel_3E [m/s^2]",
    "steering wheel": "VDC2_SteeringWheelAngle [rad]; Lenkradwinkel [°]",
    "": "RoadWheelAngle [deg]; INS_Vel_Hor_X [m/s]; INS_Roll [deg]; IMU_yaw_rate [°/s]; Gierrate [°/s]",
    "ins": (
        "oxts/imu.angular_velocity.z; INS_YawRate [deg/s]; NovAtel.yaw_rate [deg/s]; vectornav/imu.angular_velocity.x"
    ),
}


@pytest.mark.parametrize("sensor", SENSORS)
def test_the_class_of_a_sensor_by_its_name(sensor: str) -> None:
    for column in SENSORS[sensor].split("; "):
        hint = hint_of(column)
        assert hint is not None
        assert hint.sensor == sensor, column
