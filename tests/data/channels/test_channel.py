"""What each quantity is, in one place: names, several sensors on a unit, signals that nothing uses."""

import pytest

import fifthwheel as fw
from fifthwheel.data.channels import CHANNELS, IDENTIFIED, MEASURED, SensorErrorName, is_of, measured_signals
from fifthwheel.data.checks import Fault, check
from fifthwheel.estimate.filters.variances import sensor_variance

UNITS = ("tractor", "semitrailer")
REAR = "lateral_acceleration.semitrailer.rear"
SECOND = "yaw_rate.tractor.second"


@pytest.fixture(scope="module")
def truck() -> fw.Vehicle:
    return fw.vehicle("cheng_cebon_2011")


@pytest.fixture(scope="module")
def record(truck: fw.Vehicle) -> fw.Record:
    """One lane change with all gyros, a second yaw rate gyro and two accelerometers on the semitrailer."""
    gyros = [f"{quantity}.{unit}" for quantity in ("yaw_rate", "roll_rate") for unit in UNITS]
    names = (*gyros, SECOND, "lateral_acceleration.semitrailer", REAR)
    return fw.simulate(truck, count=1, seed=2, sensors={name: sensor_variance(truck, name, {}) for name in names})


def test_measurements_are_in_one_order() -> None:
    logged = [REAR, "articulation.semitrailer", "roll_rate.semitrailer", SECOND, "yaw_rate.tractor", "speed"]
    expected = ("yaw_rate.tractor", SECOND, "articulation.semitrailer", "roll_rate.semitrailer", REAR)
    assert measured_signals(logged, UNITS) == expected
    assert measured_signals(reversed(logged), UNITS, MEASURED) == expected
    assert measured_signals(["articulation.tractor", "yaw_rate.dolly"], UNITS) == ()


@pytest.mark.slow
def test_an_identification_uses_every_sensor(truck: fw.Vehicle, record: fw.Record) -> None:
    free = ("tractor.front.cornering_stiffness", "semitrailer.yaw_inertia")
    given = {"truck": "exact", **dict.fromkeys(free, "free")}
    result = fw.identify([record], truck, fw.OneStage(given=given, tyres="linear"))
    assert {SECOND, REAR} <= set(result.signals)
    errors = {error.name for error in result.sensors}
    assert {f"{SECOND}.{kind}" for kind in ("offset", "gain", "misalignment")} <= errors
    assert {f"{REAR}.{kind}" for kind in ("offset", "gain", "delay", "position", "height")} <= errors
    for name in free:
        assert abs(result[name].value - truck.parameters()[name]) < 3 * result[name].sigma


def test_what_is_found_in_several_sensors_of_a_quantity(truck: fw.Vehicle, record: fw.Record) -> None:
    """Nothing; an inverted one; a signal that nothing uses."""
    assert check(record) == ()
    inverted = record.with_signals({SECOND: -record.signals[SECOND]})
    assert {(f.signal, f.fault) for f in check(inverted)} == {(SECOND, Fault.SWAPPED_SIGN)}
    values = record.signals["yaw_rate.tractor"]
    (finding,) = check(record.with_signals({"pitch_rate.tractor": values, "sideslip.tractor": values}))
    assert (finding.fault, finding.severity) == (Fault.UNUSED, "warning")
    assert {finding.signal, *finding.others} == {"pitch_rate.tractor", "sideslip.tractor"}
    assert "[reference]" in finding.message


def test_rows_of_the_table_are_complete() -> None:
    """What estimators need of a measurement; a prior and a unit of each sensor error; faults of a gain that exist."""
    assert all(channel.model and channel.noise and channel.limit for channel in MEASURED)
    assert all(channel.errors for channel in IDENTIFIED)
    faults = {fault.value for fault in Fault}
    for channel in CHANNELS.values():
        assert not channel.turn or all(rule.fault in faults for rule in channel.turn.gain_faults)
        for error in channel.errors:
            name = SensorErrorName.of(f"{channel.quantity}.tractor.{error.kind}")
            assert error.prior > 0
            assert name is not None
            assert name.unit
    assert SensorErrorName.of("semitrailer.payload.height") is None
    assert is_of("lateral_acceleration.tractor.rear", *MEASURED)
