"""Own equations of the steering: which are refused, and how a vehicle keeps them."""

import json
import os
import pickle
import subprocess
import sys

import casadi as ca
import pytest

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.units import own_quantity
from fifthwheel.truck import Vehicle, get, unit_of

TRUCK = get("cheng_cebon_2011")
STEER, STATE = "steer.tractor.front", "actuator.tractor"


def lag(steer, states, motion, p):
    return {STEER: states[STATE]}, {STATE: (steer[STEER] - states[STATE]) / p["lag"]}


def slower(steer, states, motion, p):
    return {STEER: states[STATE]}, {STATE: (steer[STEER] - states[STATE]) / (2 * p["lag"])}


def roll_steer(steer, states, motion, p):
    return {"steer.semitrailer.rear": p["coefficient"] * motion["roll.semitrailer"]}, {}


def other_arguments(steer, motion):
    return {}, {}


def column(steer, states, motion, p):
    return {STEER: ca.vertcat(steer[STEER], 0)}, {}


def kink(steer, states, motion, p):
    return {STEER: ca.sqrt(ca.fabs(steer[STEER]))}, {}


def without_rate(steer, states, motion, p):
    return {STEER: states[STATE]}, {}


def unknown_state(steer, states, motion, p):
    return {STEER: states["actuator.semitrailer"]}, {STATE: -states[STATE]}


def unknown_steer(steer, states, motion, p):
    return {STEER: steer["steer.tractor.drive"]}, {}


def unknown_motion(steer, states, motion, p):
    return {STEER: motion["roll.trailer"]}, {}


def unknown_wheels(steer, states, motion, p):
    return {"steer.semitrailer.axle_3": steer[STEER]}, {}


def with_lag(text: str = "150 ms +- 20 %") -> Vehicle:
    return TRUCK.with_steering(lag, states={STATE: "0.01 rad"}, parameters={"lag": text})


LAG = {"states": {STATE: "0.01 rad"}, "parameters": {"lag": "0.1 s"}}


@pytest.mark.parametrize(
    ("equations", "given", "message"),
    [
        (3, {}, "expected a function, got 3"),
        (lambda steer, states, motion, p: ({}, {}), {}, "expected a function at the top level of a module"),
        (other_arguments, {}, "expected the arguments steer, states, motion, p, got steer, motion; name them so"),
        (column, {}, "two dictionaries of scalars, got steer.tractor.front with 2 elements"),
        (kink, {}, "expected finite derivatives where all is 0, got others; let the equations be smooth there"),
        (without_rate, LAG, "expected the rates of its states, actuator.tractor, got none; return the rate"),
        (unknown_state, LAG, "expected states that are stated, got actuator.semitrailer; state it; did you mean"),
        (lag, {"states": LAG["states"]}, "expected parameters that are stated, got lag; state it"),
        (unknown_steer, {}, "expected steer angles among steer.tractor.front, .*, got steer.tractor.drive; log it"),
        (unknown_motion, {}, "expected motion among speed, lateral_velocity.tractor, .*, got roll.trailer; correct"),
        (unknown_wheels, {}, "expected wheels among steer.tractor.front, .*, got steer.semitrailer.axle_3; correct"),
    ],
)
def test_what_are_no_equations_is_refused_by_name(equations, given, message: str) -> None:
    with pytest.raises(VehicleError, match=rf"steering.equations, .*: .*{message}") as error:
        TRUCK.with_steering(equations, **given)
    assert getattr(equations, "__name__", "").replace("<lambda>", "lambda") in str(error.value)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"states": {STATE: 0.01}}, "states, actuator.tractor: expected a text such as '0.15 s .*', got 0.01"),
        ({"states": {STATE: "0.01"}}, "states, actuator.tractor: expected a unit, such as '0.01 rad', got '0.01'"),
        ({"states": {STATE: "0 rad"}}, "states, actuator.tractor: expected a standard deviation above 0, got 0 rad"),
        ({"parameters": {"lag": 0.1}}, "steering.lag: expected a text such as '0.15 s .*', got 0.1"),
        ({"parameters": {"lag": "0.1 s", "gain": "2"}}, "expected parameters that the equations use, got gain"),
        ({"parameters": {"lag": "fast"}}, "steering.lag: expected a number with a unit"),
        ({"parameters": {"lag": "0.1 s", "mass": "3 s"}}, "steering.mass: expected kg, as mass elsewhere, got s"),
    ],
)
def test_states_and_parameters_have_a_unit(given, message: str) -> None:
    with pytest.raises(VehicleError, match=message):
        TRUCK.with_steering(lag, **LAG | given)


def test_what_contradicts_other_quantities_axles_or_logs_is_refused() -> None:
    coefficient, castor = {"parameters": {"coefficient": "0.1"}}, json.loads(TRUCK.model_dump_json())
    castor["units"][1]["axle_groups"][0]["axles"][-1] |= {"steerable": False, "self_steering": 0.5}
    lagged = with_lag()
    with pytest.raises(VehicleError, match=r"expected the rates of its states, yaw_rate\.tractor"):
        TRUCK.with_steering(roll_steer, states={"yaw_rate.tractor": "0.01 rad"}, **coefficient)
    with pytest.raises(VehicleError, match="actuator has the unit rad in this process, got m; give it the unit rad"):
        TRUCK.with_steering(lag, **LAG | {"states": {STATE: "0.01 m"}})
    with pytest.raises(VehicleError, match="expected wheels without self_steering and command_steering, got steer"):
        Vehicle(**castor).with_steering(roll_steer, **coefficient)
    with pytest.raises(VehicleError, match=r"expected steer angles among steer\.semitrailer\.rear, got steer\.tractor"):
        lagged.with_logged_steering(["steer.semitrailer.rear"], "the log")


def test_the_parameter_is_one_of_the_vehicle() -> None:
    truck = with_lag()
    assert truck.parameters()["steering.lag"] == pytest.approx(0.15)
    assert truck.stated == {"steering.lag": pytest.approx(0.03)}
    assert unit_of("steering.lag") == "s"
    changed = truck.replace({"steering.lag": 0.2})
    assert changed.parameters()["steering.lag"] == 0.2
    with pytest.raises(VehicleError, match=r"steering\.delay: no such parameter"):
        truck.replace({"steering.delay": 0.2})
    assert truck.with_steering(roll_steer, parameters={"coefficient": "0.1"}).stated == {}
    assert hash(truck) == hash(with_lag())


def test_a_vehicle_keeps_its_equations_in_files_and_processes() -> None:
    truck = with_lag()
    assert Vehicle.loads(truck.to_toml()) == truck
    assert Vehicle(**truck.model_dump(mode="json")) == truck
    assert pickle.loads(pickle.dumps(truck)) == truck
    assert truck.lumped().steering == truck.steering


def test_a_file_imports_no_module_and_changed_equations_are_refused() -> None:
    saved = with_lag().model_dump(mode="json")
    stored = saved["steering"]["equations"]

    def loaded(**changes: str) -> Vehicle:
        return Vehicle(**saved | {"steering": saved["steering"] | {"equations": stored | changes}})

    assert loaded().steering == with_lag().steering
    with pytest.raises(VehicleError, match="function elsewhere:lag, which is not imported; import elsewhere first"):
        loaded(function="elsewhere:lag")
    with pytest.raises(VehicleError, match=r"expected the function of this result, with .* actuator.tractor, got anot"):
        loaded(function=f"{__name__}:slower")
    for other in ("os:system", "builtins:print"):  # a file calls no other function
        with pytest.raises(VehicleError, match="expected"):
            loaded(function=other)


@pytest.mark.slow
def test_another_process_knows_the_units(tmp_path) -> None:
    (tmp_path / "own.py").write_text("from tests.truck.test_steering import lag\n")
    (tmp_path / "truck").write_bytes(pickle.dumps(with_lag()))
    program = (
        "import pickle, pathlib; truck = pickle.loads(pathlib.Path('truck').read_bytes());"
        "from fifthwheel.truck import unit_of; from fifthwheel.data.channels import si_unit;"
        "print(unit_of('steering.lag'), si_unit('actuator.tractor'))"
    )
    where = {"cwd": tmp_path, "env": os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}}
    shown = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, **where)
    assert shown.stdout.split() == ["s", "rad"]


@pytest.mark.parametrize(
    ("text", "unit", "value", "sigma"),
    [
        ("150 ms +- 20 %", "s", 0.15, 0.03),
        ("2 deg/s", "rad/s", 0.0349066, None),
        ("5 1/s", "1/s", 5.0, None),
        ("3 kN s/rad", "kg m/rad/s", 3e3, None),
        ("0.1 exact", "1", 0.1, 0.0),
    ],
)
def test_a_quantity_of_any_unit_is_in_si(text: str, unit: str, value: float, sigma: float | None) -> None:
    assert own_quantity(text) == (unit, pytest.approx(value, rel=1e-5), sigma and pytest.approx(sigma))
