"""Names of channels as databases, loggers and simulators write them, and the signals that they must be mapped to."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fifthwheel.base.units import factor
from fifthwheel.data.channels import si_unit, split_header
from fifthwheel.data.logs.name_rules import classify_column, classify_columns, is_speed_by_unit, normalised_name

UNITS = ("tractor", "semitrailer")
STEER, SPEED = "steer.tractor.front", "speed"
YAW_RATE, ROLL_RATE, ROLL = "yaw_rate.tractor", "roll_rate.tractor", "roll.tractor"
LATERAL_ACCELERATION, LATERAL_VELOCITY, SIDESLIP = (
    f"{quantity}.tractor" for quantity in ("lateral_acceleration", "lateral_velocity", "sideslip")
)
TOWED_YAW_RATE, ARTICULATION = "yaw_rate.semitrailer", "articulation.semitrailer"

CHANNELS: dict[str, dict[str | None, str]] = {
    # J1939 data of California PATH trucks (j1939_struct.h and long_read_vehicle_state); the package's own database
    "J1939, PATH": {
        YAW_RATE: "VDC2_YawRate [rad/s]",
        STEER: "VDC2_SteeringWheelAngle [rad]",
        LATERAL_ACCELERATION: "VDC2_LateralAcceleration [m/s^2]",
        SPEED: "CCVS_VehicleSpeed; CCVS.wheel_based_vehicle_speed@00 [km/h]",
        "wheel_speed.tractor.front": "EBC2_FrontAxleSpeed; EBC2.front_axle_speed@0B [km/h]",
        "wheel_speed.tractor.front.left": "HRW.front_axle_left_wheel_speed@0B [km/h]",
        "wheel_speed.tractor.rear.right": "HRW.rear_axle_right_wheel_speed@0B [km/h]",
        "wheel_speed.semitrailer.front.left": "HRW.front_axle_left_wheel_speed@C8 [km/h]",
        "lateral_acceleration.semitrailer": "EBS21.lateral_acceleration@C8 [m/s^2]",
        "gross_weight": "CVW.gross_combination_vehicle_weight@EE [kg]",
        "axle_load.tractor": "VW.axle_weight_1@EE [kg]; VW.axle_weight_2@EE [kg]; CVW.powered_vehicle_weight@EE [kg]",
        "weight.semitrailer": "VW.trailer_weight@EE [kg]",
        "engine_torque": "EEC1.actual_engine_percent_torque [%]; Motormoment [Nm]; Couple_moteur [N m]",
        "friction_torque": "EEC3.nominal_friction_percent_torque [%]",
        "driveline_engaged": "ETC1.driveline_engaged",
        "braking.tractor": "CCVS.brake_switch; Bremslicht",
        "braking.tractor.retarder": "ERC1.actual_retarder_percent_torque [%]",
        "engine_speed": "Motordrehzahl [1/min]",
        "grade": "road_grade [%]",
        None: (
            "VDC2_SteeringWheelTurnCounter; VDC2_LongitudinalAcceleration [m/s^2]; CCVS_CruiseControlSetSpeed; "
            "EBC2_RelativeSpeedFrontAxleLeftWheel; EBC2.front_axle_left_relative_speed@0B [km/h]; "
            "EEC1_DriversDemandEnginePercentTorque [%]; EngineReferenceTorque [N m]; CCVS.parking_brake_switch; "
            "EBC1.asr_brake_control_active; wheel_rpm [rpm]; steering_motor_torque [Nm]; engine_torque_mode; "
            "brake_pressure [bar]"
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
        None: "SpeedAccuracy [m/s]; SpeedValid; RollAccuracy [deg]; Heading [deg]; AccelerationZ [m/s^2]",
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
        None: "INS_Vel_Frame_X [m/s]; GNSS_Vel_Latency [s]; GNSS_Stddev_Vel_X [m/s]; INS_Stddev_Roll [deg]",
    },
    # Kistler Correvit S-Motion (CAN messages 7E0h to 7E8h); Xsens, exports of MT Manager
    "Correvit, Xsens": {
        SPEED: "vel [km/h]; vel_x [km/h]",
        LATERAL_VELOCITY: "vel_y_cor [km/h]",
        YAW_RATE: "ang_vel_z_hor [deg/s]; Gyr_Z [rad/s]",
        ROLL_RATE: "ang_vel_x_body [deg/s]; Gyr_X",
        LATERAL_ACCELERATION: "acc_y_hor [m/s^2]; Acc_Y [m/s^2]",
        None: "acc_c_body [m/s^2]; ang_vel_correction; VelInc_X [m/s]; Yaw [deg]",
    },
    # dSPACE ASM (headers of ControlDesk, with "|" for "/"); TruckSim 2020.1 (LastRun.vs of a tractor-semitrailer)
    "dSPACE, TruckSim": {
        SPEED: "v_x_Vehicle_CoG[km|h]; Vx [km/h]",
        LATERAL_VELOCITY: "v_y_Vehicle_CoG[km|h]; Vy [km/h]",
        LATERAL_ACCELERATION: "a_y_Vehicle_CoG[m|s2]; Ay [g]",
        YAW_RATE: "YawRate_Vehicle_CoG[deg|s]; AVz [deg/s]",
        ARTICULATION: "Art_H [deg]",
        STEER: "Steer_SW [deg]; Steer_L1 [deg]",
        ROLL: "Roll_E [deg]",
        None: "Angle_Yaw_Vehicle_CoorSys_E[deg]; VxTarget [km/h]; ArtR_H [deg/s]; Yaw [deg]; Roll_A1 [deg]",
    },
    # Bosch MM5.10 (ABS M5 kit); VW MQB and Toyota of opendbc; vehicle.dbc of CANoe; Dewesoft (dwdatareader)
    "cars": {
        YAW_RATE: "Yaw_Rate [°/s]; YAW_RATE [deg/s]",
        LATERAL_ACCELERATION: "AY1 [g]; ACCEL_Y [m/s^2]",
        ROLL_RATE: "Roll_Rate [°/s]",
        STEER: "LWI_Lenkradwinkel [deg]; STEER_ANGLE [deg]",
        SPEED: "ESP_v_Signal [km/h]; CarSpeed [km/h]; GPSvel [km/h]",
        "engine_speed": "EngSpeed [rpm]; EngSpeed; ENG_RPM [rpm]",
        "wheel_speed.tractor.front.left": "WHEEL_SPEED_FL [km/h]",
        None: (
            "AX1 [g]; LWI_VZ_Lenkradwinkel; LWI_QBit_Lenkradwinkel; ESP_QBit_v_Signal; ESP_Lenkeingriff_ADS; "
            "STEER_FRACTION [deg]; STEER_RATE [deg/s]; STEERING_TORQUE"
        ),
    },
    # Tests of articulated vehicles with devices on both units; abbreviated, German and French names
    "articulated vehicles": {
        SPEED: (
            "vx; v_kmh; v_GPS [km/h]; vGPS; VGPS; Speed_GPS; Geschw [km/h]; Geschw_GPS; speedo_obd; vitesse [km/h]; "
            "vitesse véhicule"
        ),
        LATERAL_VELOCITY: "Quer_Geschw [m/s]; vy [m/s]",
        "wheel_speed.tractor.rear.right": "VelRR_obd",
        "wheel_speed.tractor": "vitesse_roue",
        STEER: (
            "RoadWheelAngle [deg]; SteeringWheelAngle [deg]; LRW [deg]; HWA; StWhlAng [deg]; SW_pos_obd; "
            "angle_volant [deg]; delta_front [deg]; LWI_Winkel_deg"
        ),
        TOWED_YAW_RATE: (
            "TrlIMU_GyrZ [deg/s]; YAW_TRL [deg/s]; TrailerYawRate [rad/s]; Gyro_Z_2 [deg/s]; GierSA [deg/s]; "
            "Gierrate Sattelauflieger; lacet_remorque [deg/s]; YawRate_Trailer [deg/s]; psi_dot_2 [rad/s]; "
            "IMU2_GyroZ [deg/s]; yawTrl [deg/s]"
        ),
        YAW_RATE: (
            "YAW [deg/s]; vitesse_lacet [deg/s]; psi [deg/s]; imu/angular_velocity.z; GyroZ_Tr [deg/s]; "
            "YawRate@0B [rad/s]; Gierrate Zugm. [°/s]"
        ),
        ROLL_RATE: "phi [deg/s]; vitesse_roulis; gyroX; Wankrate [°/s]",
        ROLL: "phi [deg]",
        "roll_rate.semitrailer": "WankSA [deg/s]; RollRate@IMU_Trailer [deg/s]",
        "roll.semitrailer": "WankSA [deg]",
        ARTICULATION: "articulationAngle [rad]; angle_attelage [deg]; hitch",
        LATERAL_ACCELERATION: "acceleration_laterale [m/s^2]; Querbeschleunigung [m/s^2]; ay1 [g]",
        SIDESLIP: "angle_de_dérive [deg]; beta [deg]",
        None: (
            "YAW [deg]; YAW; YAW_TRL [deg]; LRW_Geschw [deg/s]; LRW_Geschw; couple_volant; lacet; psi [deg]; "
            "Lenkwinkelgeschwindigkeit [°/s]; hitch_rate"
        ),
    },
    # Velocities on axes of the earth; constructed contradictions of unit, name and quantity
    "contradictions": {
        None: (
            "ecef_vy [m/s]; ECEF_vel_x [m/s]; ECEF_vel_y [m/s]; bestxyz.vel_y; vel_y_ned [m/s]; Speed [rad/s]; "
            "AngularVelocity; WheelSpeed [rpm]; SteeringWheelSpeed [deg/s]; SteeringWheelSpeed; YawRate [V]; "
            "YawRate [deg/s^2]; SteeringAngle [%]; WheelSlip_FL [%]; WindSpeed [m/s]; delta_t [s]; deltaQ; "
            "engine_temp [degC]; yaw_rate_status; t [s]"
        )
    },
}
"""By source and signal, names of columns with their units in brackets."""


def hint_of(column, unit=None):
    name, header_unit = split_header(column)
    return classify_column(name, unit or header_unit)


def signal_of(column, unit=None):
    hint = hint_of(column, unit)
    return None if hint is None else hint.signal(UNITS)


@pytest.mark.parametrize("source", CHANNELS)
def test_a_channel_is_mapped_to_its_signal(source):
    expected = {name: signal for signal, names in CHANNELS[source].items() for name in names.split("; ")}
    assert {name: signal_of(name) for name in expected} == expected
    assert all(signal is None or si_unit(signal) for signal in expected.values())


STEERING_WHEEL = "SteeringWheelAngle Lenkradwinkel Steer_SW VDC2_SteerWhlAngle_0B LRW HWA StWhlAng delta_LRW SW_pos_obd"
ROAD_WHEEL = "delta road_wheel_steer_angle RoadWheelAngle Steer_L1"


def test_angles_of_the_steering_wheel_and_of_the_road_wheels():
    for name in [*STEERING_WHEEL.split(), "angle_volant", *ROAD_WHEEL.split()]:
        assert classify_column(name, "deg").steering_wheel == (name not in ROAD_WHEEL.split()), name


def test_a_speed_by_its_unit_and_range():
    for column, unit, low, high, expected in [
        ("Kanal 7", "km/h", 0.0, 80.0, True),
        ("ch12", "mph", -0.1, 55.0, True),
        ("Kanal 7", "km/h", 0.0, 12.0, False),
        ("Kanal 7", "km/h", 0.0, 400.0, False),
        ("Kanal 7", "km/h", -80.0, 80.0, False),
        ("Kanal 7", "m/s", 0.0, 25.0, False),
        ("Kanal 7", None, 0.0, 80.0, False),
        ("Kanal 7", "deg", 0.0, 80.0, False),
        *((name, "km/h", 0.0, 80.0, False) for name in ("cruise_set", "wind", "north")),
    ]:
        assert is_speed_by_unit(column, unit, low, high) == expected, column


def test_a_repeated_name_does_not_number_the_vehicle_unit():
    alone = classify_columns({"Gyro_Z_1": "deg/s", "Gyro_Z_2": "deg/s"})
    assert [hint.trailing for hint in alone.values()] == [False, True]
    names = {"Gyro_Z": "deg/s", "Gyro_Z_1": "deg/s", "tractor_gyro_z": None, "tractor_gyro_z_1": None}
    assert [hint.trailing for hint in classify_columns(names).values()] == [None, None, False, False]


def test_words_and_units_in_a_name():
    assert normalised_name("YawRate-Lkw (2)") == "yaw_rate_lkw_2"
    assert normalised_name("Gierwinkelgeschw. Äx") == "gierwinkelgeschw_aex"
    assert normalised_name("VDC2YawRate_3E") == "vdc2_yaw_rate_3e"
    assert normalised_name("TrlIMU_GyrZ") == "trl_imu_gyr_z"
    for name, unit in {"v_kmh": "km/h", "yaw_rate_deg_s": "deg/s", "ay_mps2": "m/s^2", "yaw_rate": None}.items():
        assert classify_column(name, None).unit == unit


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


LONG = ("tractor", "first", "dolly", "second")


def test_columns_of_a_long_combination() -> None:
    """By the name of the unit, else its number, else the last unit for a trailer; of a single unit there is none."""
    for column, signal in {
        "Dolly yaw rate [deg/s]": "yaw_rate.dolly",
        "gz_first": "yaw_rate.first",
        "yaw_rate_3": "yaw_rate.dolly",
        "imu2_gyro_x": "roll_rate.first",
        "articulation_dolly": "articulation.dolly",
        "articulation_angle": "articulation.second",
        "trailer_yaw_rate": "yaw_rate.second",
        "tractor_ay": "lateral_acceleration.tractor",
        "yaw_rate": "yaw_rate.tractor",
    }.items():
        assert hint_of(column).signal(LONG) == signal
    assert hint_of("hitch").signal(["tractor"]) == "articulation.tractor"


SENSORS = {
    "vdc2": "VDC2_YawRate_3E; VDC2.yaw_rate@0B [rad/s]; VDC2_LatAccel_3E [m/s^2]",
    "steering wheel": "VDC2_SteeringWheelAngle [rad]; Lenkradwinkel [°]",
    "": "RoadWheelAngle [deg]; INS_Vel_Hor_X [m/s]; INS_Roll [deg]; IMU_yaw_rate [°/s]; Gierrate [°/s]",
    "ins": (
        "oxts/imu.angular_velocity.z; INS_YawRate [deg/s]; NovAtel.yaw_rate [deg/s]; vectornav/imu.angular_velocity.x"
    ),
}


def test_the_class_of_a_sensor_by_its_name() -> None:
    for sensor, columns in SENSORS.items():
        for column in columns.split("; "):
            assert hint_of(column).sensor == sensor, column
