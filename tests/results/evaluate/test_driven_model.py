"""Models driven with the inputs of a log: an FMU through a double of FMPy, a real FMU, the nonlinear truck."""

import importlib.util
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.base.errors import FifthwheelError, SignalError
from fifthwheel.results.evaluate.driven_model import APPROACH, fmu_results, plant_results

TRUCK = fw.vehicle("cheng_cebon_2011")
STEER = "steer.tractor.front"
INPUTS = {"speed": "km/h", STEER: "deg", "bank.road": "rad"}
OUTPUTS = {"yaw_rate.tractor": "deg/s", "roll.tractor": None, "engine.torque": "N m"}


def log(start=100.0, rate=20.0):
    """A bend to the left that begins in the middle of the log, whose sensors miss a sample."""
    time = start + np.arange(0, 10, 1 / rate)
    steer = 0.02 + 0.01 * np.clip(time - start - 5, 0, 1)
    speed = np.full(time.size, 20.0)
    steer[7] = np.nan
    return fw.Record(time=time, signals={"speed": speed, STEER: steer}, name="bend")


class Model:
    """FMPy with one FMU: the yaw rate is the speed times the steer angle of 0.1 s ago, in the units of the FMU."""

    def __init__(self, inputs=INPUTS, outputs=OUTPUTS, error=None):
        units = [("input", inputs), ("output", outputs)]
        self.variables = [SimpleNamespace(name=n, causality=c, unit=u) for c, of in units for n, u in of.items()]
        self.error, self.called = error, None

    def read_model_description(self, path, validate):
        return SimpleNamespace(modelVariables=self.variables)

    def simulate_fmu(self, path, **given):
        self.called = given
        if self.error:
            print("[ERROR] speed: too fast")
            raise self.error
        time = np.arange(0, given["stop_time"] + given["output_interval"] / 2, given["output_interval"])
        table = given["input"]
        at = time - given["output_interval"] / 2  # of the input that was set at the start of the step before
        rate = np.interp(at, table["time"], table["speed"] / 3.6) * np.interp(at - 0.1, table["time"], table[STEER])
        columns = {"time": time, **dict.fromkeys(given["output"], rate)}
        return np.rec.fromarrays(list(columns.values()), dtype=[(n, float) for n in columns])


@pytest.fixture
def use(monkeypatch, tmp_path):
    """Put a model in the place of FMPy; the path of its FMU."""

    def put(**given):
        model = Model(**given)
        monkeypatch.setitem(sys.modules, "fmpy", model)
        return model

    (tmp_path / "truck.fmu").write_bytes(b"PK")
    put.path = tmp_path / "truck.fmu"
    return put


def test_inputs_and_outputs_have_the_units_of_the_fmu_and_the_times_of_the_log(use):
    model, record = use(), log()
    found = fmu_results(use.path, record)
    np.testing.assert_array_equal(found.time, record.time)
    table = model.called["input"]
    assert table.dtype.names == ("time", "speed", STEER)
    assert table["speed"] == pytest.approx(72.0)
    assert table[STEER][[0, 1]] == pytest.approx([0.0, np.degrees(0.02)])  # straight ahead, then the log
    assert model.called["stop_time"] == pytest.approx(APPROACH + record.time[-1] - record.time[0])
    delayed = np.interp(record.time - 0.1, record.time, record.input(STEER), left=0.02)
    late = record.time > record.time[0] + 0.2
    np.testing.assert_allclose(found.signals["yaw_rate.tractor"][late], 20 * delayed[late], rtol=1e-3)
    assert model.called["output"] == ["yaw_rate.tractor", "roll.tractor"]
    assert found.signals[STEER][7] == pytest.approx(0.02)
    assert found.notes == (
        "truck.fmu: inputs that are not in the log keep their start value: bank.road.",
        "truck.fmu: outputs that are not evaluated: engine.torque.",
    )


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"inputs": {"speed": "m/s", "delta": "rad"}}, rf"truck\.fmu: no input {STEER}.*has speed, delta; rename"),
        ({"inputs": {}}, "it has no inputs"),
        (
            {"outputs": {"psi_dot": "rad/s"}},
            r"with the name of a signal \(yaw_rate\.<unit>, .*\), got psi_dot; rename its outputs",
        ),
        ({"outputs": {"yaw_rate.tractor": "kg"}}, r"yaw_rate\.tractor: unit kg.*change it in the FMU"),
        ({"inputs": {**INPUTS, "measured.yaw_rate.tractor": "rad/s"}}, "input of an observer; export the truck"),
    ],
)
def test_an_fmu_with_other_variables_is_refused(use, given, message):
    use(**given)
    with pytest.raises(SignalError, match=message):
        fmu_results(use.path, log())


def test_an_error_of_the_fmu_has_its_message(use, capsys):
    use(error=RuntimeError("fmi3DoStep failed"))
    with pytest.raises(FifthwheelError, match=r"cannot be run \(fmi3DoStep failed \[ERROR\] speed: too fast\); check"):
        fmu_results(use.path, log())
    assert capsys.readouterr().out == ""
    with pytest.raises(FifthwheelError, match="No such file"):
        fmu_results(use.path.with_name("other.fmu"), log())


def test_fmpy_is_needed(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "fmpy", None)
    with pytest.raises(FifthwheelError, match=r"pip install 'fifthwheel\[fmu\]'"):
        fmu_results(tmp_path / "truck.fmu", log())


def test_the_nonlinear_truck_turns_as_its_understeer_says():
    pytest.importorskip("mujoco")
    record = fw.simulate(TRUCK, manoeuvre="step", rate=20.0, duration=4.0)
    found = plant_results(TRUCK, record)
    np.testing.assert_array_equal(found.time, record.time)
    steer, speed = record.signals[STEER][-1], record.signals["speed"][-1]
    linear = speed * steer / (TRUCK.wheelbase + fw.summarize(TRUCK).understeer_gradient * speed**2 / 9.80665)
    assert found.signals[STEER][-1] == pytest.approx(steer)
    assert found.signals["yaw_rate.tractor"][-1] == pytest.approx(linear, rel=0.15)
    assert abs(found.signals["yaw_rate.tractor"][0]) < 1e-3


@pytest.mark.slow
@pytest.mark.skipif(
    not all(map(importlib.util.find_spec, ("fmpy", "ziglang"))), reason="not installed: pip install ziglang fmpy"
)
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_the_exported_truck_is_the_simulation(tmp_path):
    from fifthwheel.results.export import export_fmu

    truck = TRUCK.with_logged_steering([STEER], "the test")
    export_fmu(truck, tmp_path / "truck.fmu", platforms=("x86_64-linux",))
    record = fw.simulate(truck, manoeuvre="lane_changes", count=1, seed=1)
    found = fmu_results(tmp_path / "truck.fmu", record)
    for name in ("roll.semitrailer", "articulation.semitrailer", "sideslip.tractor"):
        largest = np.abs(record.reference[name]).max()
        np.testing.assert_allclose(found.signals[name], record.reference[name], atol=1e-3 * largest)
    assert fw.validate(found, record, "lane_change", vehicle=truck).verdict != "outside"
