"""Names of channels as databases, loggers and simulators write them, and the signals that they must be mapped to."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fifthwheel.base.units import factor
from fifthwheel.data.channels import si_unit, split_header
from fifthwheel.data.logs.name_rules import classify_column, classify_columns, normalised_name

UNITS = ("tractor", "semitrailer")
STEER, SPEED = "steer.tractor.front", "speed"
YAW_RATE, ROLL_RATE, ROLL = "yaw_rate.tractor", "roll_rate.tractor", "roll.tractor"
LATERAL_ACCELERATION, LATERAL_VELOCITY, SIDESLIP = (
    f"{quantity}.tractor" for quantity in ("lateral_acceleration", "lateral_velocity", "sideslip")
)
TOWED_YAW_RATE, ARTICULATION = "yaw_rate.semitrailer", "articulation.semitrailer"

CHANNELS: dict[str | None, str] = {
    YAW_RATE: (
        "VDC2_YawRate [rad/s]; VDC2_YawRate_3E; AngularRateZ [deg/s]; Yaw_rate [deg/s]; IMU_yaw_rate [°/s]; "
        "AngRateZ [°/s]; AngRateDown [°/s]; IsoVsYawVelocity [°/s]; Rate_Hor_Z [deg/s]; ang_vel_z_hor [deg/s]; "
        "Gyr_Z [rad/s]; YawRate_Vehicle_CoG[deg|s]; AVz [deg/s]; Yaw_Rate [°/s]; YAW_RATE [deg/s]; YAW [deg/s]; "
        "vitesse_lacet [deg/s]; psi [deg/s]; imu/angular_velocity.z; GyroZ_Tr [deg/s]; YawRate@0B [rad/s]; "
        "Gierrate Zugm. [°/s]"
    ),
    STEER: (
        "VDC2_SteeringWheelAngle [rad]; VDC2_SteerWhlAngle_0B [rad]; Steer_SW [deg]; Steer_L1 [deg]; "
        "LWI_Lenkradwinkel [deg]; STEER_ANGLE [deg]; RoadWheelAngle [deg]; SteeringWheelAngle [deg]; LRW [deg]; HWA; "
        "StWhlAng [deg]; SW_pos_obd; angle_volant [deg]; delta_front [deg]; LWI_Winkel_deg"
    ),
    LATERAL_ACCELERATION: (
        "VDC2_LateralAcceleration [m/s^2]; VDC2_LatAccel_3E [m/s^2]; AccelerationY [m/s^2]; Lateral_acceleration [G]; "
        "Lat_acc [g]; Latacc [g]; AccelY [m/s²]; AccelLateral [m/s²]; Acc_Hor_Y [g]; Acc_Body_Y_POI2 [g]; "
        "acc_y_hor [m/s^2]; Acc_Y [m/s^2]; a_y_Vehicle_CoG[m|s2]; Ay [g]; AY1 [g]; ACCEL_Y [m/s^2]; "
        "acceleration_laterale [m/s^2]; Querbeschleunigung [m/s^2]; ay1 [g]"
    ),
    SPEED: (
        "CCVS_VehicleSpeed; CCVS.wheel_based_vehicle_speed@00 [km/h]; TCO1_VehSpd_EE [km/h]; "
        "WheelBasedVehicleSpeed [km/h]; Speed [m/s]; Velocity_Kmh [Km/h]; Velocity_Kmh; velocity kmh; X_velocity; "
        "Speed2D [m/s]; VelForward [m/s]; IsoIsLongitudinalVelocity [m/s]; INS_Vel_Hor_X [m/s]; vel [km/h]; "
        "vel_x [km/h]; v_x_Vehicle_CoG[km|h]; Vx [km/h]; ESP_v_Signal [km/h]; CarSpeed [km/h]; GPSvel [km/h]; vx; "
        "v_kmh; v_GPS [km/h]; vGPS; VGPS; Speed_GPS; Geschw [km/h]; Geschw_GPS; speedo_obd; vitesse [km/h]; "
        "vitesse véhicule"
    ),
    "wheel_speed.tractor.front": "EBC2_FrontAxleSpeed; EBC2.front_axle_speed@0B [km/h]; EBC2_MeanSpdFA_0B [km/h]",
    "wheel_speed.tractor.front.left": "HRW.front_axle_left_wheel_speed@0B [km/h]; WHEEL_SPEED_FL [km/h]",
    "wheel_speed.tractor.rear.right": "HRW.rear_axle_right_wheel_speed@0B [km/h]; VelRR_obd",
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
    "engine_speed": (
        "Motordrehzahl [1/min]; EEC1_EngSpd_00 [rpm]; EngineSpeed [rpm]; EngineSpeed; EngSpeed [rpm]; EngSpeed; "
        "ENG_RPM [rpm]"
    ),
    "grade": "road_grade [%]",
    ROLL: "Roll [deg]; Roll_angle [deg]; AngleRoll [°]; INS_Roll [deg]; Roll_E [deg]; phi [deg]",
    ROLL_RATE: (
        "AngularRateX [deg/s]; IMU_roll_rate [°/s]; AngRateX [°/s]; Rate_Body_X [deg/s]; ang_vel_x_body [deg/s]; "
        "Gyr_X; Roll_Rate [°/s]; phi [deg/s]; vitesse_roulis; gyroX; Wankrate [°/s]"
    ),
    LATERAL_VELOCITY: (
        "Lateral_vel [Km/h]; Y_velocity; VelLateral [m/s]; INS_Vel_Hor_Y [m/s]; vel_y_cor [km/h]; "
        "v_y_Vehicle_CoG[km|h]; Vy [km/h]; Quer_Geschw [m/s]; vy [m/s]"
    ),
    SIDESLIP: "Slip_angle [deg]; AngleSlip [°]; Side_Slip_Angle [deg]; angle_de_dérive [deg]; beta [deg]",
    ARTICULATION: "Art_H [deg]; articulationAngle [rad]; angle_attelage [deg]; hitch",
    "wheel_speed.tractor": "vitesse_roue",
    TOWED_YAW_RATE: (
        "TrlIMU_GyrZ [deg/s]; YAW_TRL [deg/s]; TrailerYawRate [rad/s]; Gyro_Z_2 [deg/s]; GierSA [deg/s]; "
        "Gierrate Sattelauflieger; lacet_remorque [deg/s]; YawRate_Trailer [deg/s]; psi_dot_2 [rad/s]; "
        "IMU2_GyroZ [deg/s]; yawTrl [deg/s]"
    ),
    "roll_rate.semitrailer": "WankSA [deg/s]; RollRate@IMU_Trailer [deg/s]",
    "roll.semitrailer": "WankSA [deg]",
    None: (
        "VDC2_SteeringWheelTurnCounter; VDC2_LongitudinalAcceleration [m/s^2]; CCVS_CruiseControlSetSpeed; "
        "EBC2_RelativeSpeedFrontAxleLeftWheel; EBC2.front_axle_left_relative_speed@0B [km/h]; "
        "EEC1_DriversDemandEnginePercentTorque [%]; EngineReferenceTorque [N m]; CCVS.parking_brake_switch; "
        "EBC1.asr_brake_control_active; wheel_rpm [rpm]; steering_motor_torque [Nm]; engine_torque_mode; "
        "brake_pressure [bar]; VDC2_SteerWhlTurnCnt_0B; EEC2_AccPedalPos1_00 [%]; TSRSpeedLimit [km/h]; "
        "SpeedAccuracy [m/s]; SpeedValid; RollAccuracy [deg]; Heading [deg]; AccelerationZ [m/s^2]; Trig_Vel_Kmh; "
        "Vertical_Velocity [m/s]; vert-vel; Slip_Angle_Front_Left [°]; True_heading; VelNorth [m/s]; VelDown [m/s]; "
        "AccelSlip [m/s²]; AngleHeading [°]; AngRateLateral [°/s]; AngAccelLateral [°/s²]; AngAccelLateral; "
        "IsoVsYawAcceleration [°/s²]; INS_Vel_Frame_X [m/s]; GNSS_Vel_Latency [s]; GNSS_Stddev_Vel_X [m/s]; "
        "INS_Stddev_Roll [deg]; acc_c_body [m/s^2]; ang_vel_correction; VelInc_X [m/s]; Yaw [deg]; "
        "Angle_Yaw_Vehicle_CoorSys_E[deg]; VxTarget [km/h]; ArtR_H [deg/s]; Roll_A1 [deg]; AX1 [g]; "
        "LWI_VZ_Lenkradwinkel; LWI_QBit_Lenkradwinkel; ESP_QBit_v_Signal; ESP_Lenkeingriff_ADS; STEER_FRACTION [deg]; "
        "STEER_RATE [deg/s]; STEERING_TORQUE; YAW [deg]; YAW; YAW_TRL [deg]; LRW_Geschw [deg/s]; LRW_Geschw; "
        "couple_volant; lacet; psi [deg]; Lenkwinkelgeschwindigkeit [°/s]; hitch_rate; ecef_vy [m/s]; "
        "ECEF_vel_x [m/s]; ECEF_vel_y [m/s]; bestxyz.vel_y; vel_y_ned [m/s]; Speed [rad/s]; AngularVelocity; "
        "WheelSpeed [rpm]; SteeringWheelSpeed [deg/s]; SteeringWheelSpeed; YawRate [V]; YawRate [deg/s^2]; "
        "SteeringAngle [%]; WheelSlip_FL [%]; WindSpeed [m/s]; delta_t [s]; deltaQ; engine_temp [degC]; "
        "yaw_rate_status; t [s]"
    ),
}
"""By signal, names of columns with their units in brackets, of: J1939 (PATH trucks, Knorr-Bremse, CSS Electronics),
VBOX, OxTS, ADMA, Kistler Correvit, Xsens, dSPACE ASM ("|" for "/"), TruckSim 2020.1, Bosch MM5.10, VW and Toyota of
opendbc, CANoe, Dewesoft, tests of articulated vehicles, abbreviated, German and French names; contradictions."""


def hint_of(column, unit=None):
    name, header_unit = split_header(column)
    return classify_column(name, unit or header_unit)


def signal_of(column, unit=None):
    hint = hint_of(column, unit)
    return None if hint is None else hint.signal(UNITS)


@pytest.mark.parametrize("signal", CHANNELS)
def test_a_channel_is_mapped_to_its_signal(signal):
    names = CHANNELS[signal].split("; ")
    assert {name: signal_of(name) for name in names} == dict.fromkeys(names, signal)
    assert signal is None or si_unit(signal)


STEERING_WHEEL = "SteeringWheelAngle Lenkradwinkel Steer_SW VDC2_SteerWhlAngle_0B LRW HWA StWhlAng delta_LRW SW_pos_obd"
ROAD_WHEEL = "delta road_wheel_steer_angle RoadWheelAngle Steer_L1"


def test_angles_of_the_steering_wheel_and_of_the_road_wheels():
    for name in [*STEERING_WHEEL.split(), "angle_volant", *ROAD_WHEEL.split()]:
        assert classify_column(name, "deg").steering_wheel == (name not in ROAD_WHEEL.split()), name


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
