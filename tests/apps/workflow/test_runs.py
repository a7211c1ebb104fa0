"""The runs as functions of data: what they return and write, estimators for export, and surveys of logs."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet

from fifthwheel.apps.workflow.inputs import propose_signals, read_records, survey_files
from fifthwheel.apps.workflow.results import write_results
from fifthwheel.apps.workflow.runs import (
    IdentificationRun,
    exported_learner,
    exported_observer,
    run_identification,
    run_states,
)
from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.base.options import ObserverOptions
from fifthwheel.data.checks import Fault
from fifthwheel.data.logs import source as sampling
from fifthwheel.data.logs import write_record
from fifthwheel.data.logs.readers import text as text_reader
from fifthwheel.data.logs.survey import survey_log
from fifthwheel.estimate.identify import Identification, OneStage, identify
from fifthwheel.estimate.observe import Observer, ObserverSettings
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle, get

TRUCK = get("cheng_cebon_2011")
RUN, OTHER = simulate(TRUCK, count=2, seed=1, name="run"), simulate(TRUCK, count=1, seed=2, name="other")
LINEAR = OneStage(tyres="linear")
FIVE = OneStage(given={"others": "exact", "sensors": "exact", "road.bank": "+- 0.03 rad"}, tyres="linear")
HEIGHT = "semitrailer.payload.height"
NAMES = {"identification.json", "vehicle.toml", "states.parquet", "report.html", "knowledge.json"}


def test_excluded_windows_of_all_logs_and_of_one(tmp_path):
    for record in (RUN, OTHER):
        write_record(record, tmp_path / f"{record.name}.csv")
    paths = [tmp_path / "run.csv", tmp_path / "other.csv"]
    run, other = read_records(paths, exclude={"": [(1.0, 2.0)], "other": [(4.0, 5.0)]})
    left = (RUN.time < 1.0) | (RUN.time > 2.0)
    np.testing.assert_array_equal(run.time, RUN.time[left])
    np.testing.assert_array_equal(run.signals["speed"], RUN.signals["speed"][left])
    assert [segment.span for segment in other.segments()] == [(2.01, 3.99), (5.01, OTHER.span[1])]  # longer than 1 s
    with pytest.raises(SignalError, match="runn: windows are excluded, but there is no such log; did you mean 'run'"):
        read_records(paths, exclude={"runn": [(1.0, 2.0)]})


@pytest.fixture(scope="module")
def progress() -> list[tuple[str, int, int]]:
    return []


@pytest.fixture(scope="module")
def run(progress) -> IdentificationRun:
    return run_identification([RUN], TRUCK, LINEAR, validate=[OTHER], progress=lambda *call: progress.append(call))


@pytest.fixture(scope="module")
def contents(run) -> str:
    """What identification.json of the run contains: see `test_files_of_an_identification`."""
    return json.dumps(run.as_dict())


@pytest.mark.slow
def test_an_identification_with_its_states(run, progress, capsys):
    plain = identify([RUN], TRUCK, LINEAR, validate=[OTHER])
    assert run.identification.to_json() == plain.to_json()
    assert [record.name for record in run.records] == [states.name for states in run.states] == ["run", "other"]
    observer = Observer(plain.vehicle, RUN.signals, plain.observer_settings("run"))
    expected = observer.batch(RUN, plain.uncertainty("run"))
    for name, values in expected.values.items():
        np.testing.assert_array_equal(run.states[0].values[name], values)
        np.testing.assert_array_equal(run.states[0].sigma[name], expected.sigma[name])
    assert [call for call in progress if call[0] == "states"] == [("states", k, 2) for k in range(3)]
    assert capsys.readouterr() == ("", "")
    assert run.outlook["semitrailer.payload.height"].remedies  # the payload height is uncertain
    assert run.as_dict()["conclusion"] == run.conclusion.as_dict()
    assert "other" in " ".join(run.conclusion.results)


@pytest.mark.slow
def test_remedies_are_predicted_with_the_stated_sigma():
    """The identified vehicle has the sigma of the result, which contains the logs already."""
    run = run_identification([RUN], TRUCK.with_stated({HEIGHT: 0.4}), LINEAR)
    sigma = run.identification[HEIGHT].sigma
    assert sigma < 0.3
    assert run.identification.vehicle.stated == {HEIGHT: pytest.approx(sigma, rel=6e-3)}
    assert run.outlook[HEIGHT].prior == pytest.approx(0.4, rel=1e-6)


@pytest.mark.slow
def test_files_of_an_identification(run, tmp_path):
    files = write_results(run, tmp_path, name="bend <1>")
    page = files["report.html"].read_text()
    assert f"<title>{TRUCK.name}, bend &lt;1&gt;: fifthwheel</title>" in page
    assert f'<h1>{TRUCK.name}<span class="result">, bend &lt;1&gt;</span></h1>' in page
    assert set(files) == {path.name for path in tmp_path.iterdir()} == NAMES
    assert json.loads(files["identification.json"].read_text()) == json.loads(json.dumps(run.as_dict()))
    assert Vehicle.load(files["vehicle.toml"]).parameters() == pytest.approx(run.identification.vehicle.parameters())
    assert set(parquet.read_table(files["states.parquet"])["log"].to_pylist()) == {"run", "other"}
    stored = Identification.load(files["identification.json"])
    assert [log.name for log in stored.logs] == ["run"]
    assert stored.covariance.names == run.identification.covariance.names


@pytest.mark.slow
def test_an_assumed_number_remains_assumed_with_the_sigma_of_its_class(run, tmp_path):
    path, estimated = "tractor.yaw_inertia", "semitrailer.yaw_inertia"
    sources = dict.fromkeys((path, estimated), "class")
    guess = Vehicle(**TRUCK.model_dump() | {"assumed": sources, "stated": {path: 4400.0, estimated: 1e5}})
    found = replace(run.identification, initial_vehicle=guess)
    for text in (None, guess.to_toml()):
        files = write_results(replace(run, identification=found), tmp_path, vehicle_text=text)
        written = Vehicle.load(files["vehicle.toml"])
        assert written.stated.items() >= {path: 4400.0}.items()
        assert written.assumed == {path: "class"}
        assert written.parameters() == pytest.approx(run.identification.vehicle.parameters())


@pytest.mark.slow
def test_states_with_the_sensor_errors_of_each_log(run, contents, tmp_path, capsys):
    (tmp_path / "identification.json").write_text(contents)
    stored = Identification.load(tmp_path / "identification.json")
    vehicle = run.identification.vehicle
    states = run_states([RUN, OTHER], vehicle, identification=stored)
    (note,) = states.notes
    assert note == "other: not a log of the identification; its sensor errors are estimated from the log itself"
    for k in range(2):
        for name, values in run.states[k].values.items():
            np.testing.assert_allclose(states.states[k].values[name], values, rtol=1e-6, atol=1e-9)
    assert states.uncertain == stored.covariance.names
    assert capsys.readouterr() == ("", "")
    slow = OTHER.with_signals({"speed": np.ones(len(OTHER))})
    unknown = run_states([slow], vehicle, identification=stored, check=False).notes[0]
    assert unknown.startswith("other: not a log of the identification; its sensor errors are unknown")
    (tmp_path / "states").mkdir()
    assert set(write_results(states, tmp_path / "states")) == {"states.json", "states.parquet", "report.html"}


def test_states_alone():
    settings = ObserverSettings(min_speed=30.0)
    states = run_states([RUN], TRUCK, settings, smooth=True)
    assert (states.smoothed, states.uncertain, states.notes) == (True, (), ())
    assert states.as_dict()["logs"][0]["status"]["too_slow"] == 1.0
    inverted = RUN.with_signals({"yaw_rate.tractor": -RUN.signals["yaw_rate.tractor"]})
    with pytest.raises(SignalError, match=r"^yaw_rate\.tractor: "):
        run_states([inverted], TRUCK)
    assert run_states([inverted], TRUCK, check=False).states


def test_another_file_than_identification_json_is_refused(tmp_path):
    path = tmp_path / "identification.json"
    logs = '{"sensors": [], "logs": [{"name": "a"}]}'
    message = r"identification\.json: not an? (identification\.json|JSON file).*; .* `fifthwheel identify`"
    for text in ("", "[]", "{}", '{"sensors": []}', '{"sensors": [], "logs": []}', logs, "3"):
        path.write_text(text)
        with pytest.raises(SignalError, match=message):
            Identification.load(path)


@pytest.mark.slow
@pytest.mark.parametrize("place", ["sensor error", "sensor error of a log", "noise"])
def test_a_stored_value_that_is_not_a_number_is_refused(contents, tmp_path, place):
    """It made all states NaN with the status OK."""
    path, contents = tmp_path / "identification.json", json.loads(contents)
    name = "yaw_rate.tractor" if place == "noise" else "yaw_rate.tractor.offset"
    for value in (math.nan, None, math.inf, "0.1"):
        if place == "noise":
            contents["logs"][0]["noise"][name] = value
        else:
            error = next(error for error in contents["sensors"] if error["name"] == name)
            error |= {"value": value, "log": "run" if place == "sensor error of a log" else None}
        path.write_text(json.dumps(contents))
        with pytest.raises(SignalError, match=f"^{re.escape(str(path))}: (sensor_errors, |noise, )?{name}: expected "):
            Identification.load(path)


@pytest.fixture(scope="module")
def result() -> Identification:
    return identify([simulate(TRUCK, count=1, seed=1)], TRUCK, FIVE)


@pytest.mark.slow
def test_a_learner_and_an_observer_of_an_identification(result: Identification) -> None:
    live = exported_learner(result.vehicle, None, result, min_speed=7.0, passes=2, segment=300).live
    assert {*live.setup.inputs, *live.setup.outputs} == set(result.signals)
    assert live.setup.settings == replace(FIVE, min_speed=7.0)
    assert (live.learner.relinearisation.max_passes, live.learner.relinearisation.samples) == (2, 300)
    with pytest.raises(SignalError, match=r"yaw_rate\.semitrailr: no signal that a learner .*did you mean"):
        exported_learner(TRUCK, [*result.signals, "yaw_rate.semitrailr"], result)
    observer = exported_observer(result.vehicle, None, result)
    assert {*observer.inputs, *observer.outputs} == set(result.signals)
    assert observer.settings == result.observer_settings()
    with pytest.raises(VehicleError, match=r"auburn.*not those of the identification.*vehicle\.toml"):
        exported_observer(get("auburn_6x4"), None, result)


def test_an_observer_with_the_signals_of_a_vehicle() -> None:
    observer = exported_observer(TRUCK, options=ObserverOptions(min_speed=7.0, friction=0.3, half_track=0.92))
    settings = observer.settings
    assert (settings.min_speed, settings.friction, settings.half_track) == (7.0, 0.3, 0.92)
    assert observer.inputs == ("speed", *TRUCK.steer_signals())
    assert len(observer.outputs) == 4
    with pytest.raises(SignalError, match=r"yaw_rate\.semitrailr: no signal that an observer .*did you mean"):
        exported_observer(TRUCK, ["speed", "steer.tractor.front", "yaw_rate.tractor", "yaw_rate.semitrailr"])


@pytest.mark.slow
def test_a_sample_of_a_large_log_gives_the_map_of_the_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The pauses between the parts of the sample are not faults of the log."""
    truck = get("cheng_cebon_2011")
    record = simulate(truck, count=20)
    names = {"v_GPS [m/s]": "speed", "GierSZM [rad/s]": "yaw_rate.tractor", "GierSA [rad/s]": "yaw_rate.semitrailer"}
    columns = [record.time, *(record.signals[name] for name in names.values()), -record.signals["steer.tractor.front"]]
    path = tmp_path / "log.csv"
    np.savetxt(path, np.column_stack(columns), "%.5f", ",", header=",".join(["t", *names, "delta"]), comments="")
    whole = survey_files([path])
    monkeypatch.setattr(sampling, "_LARGE", 1e4)
    monkeypatch.setattr(sampling, "_PART", path.stat().st_size / 40)
    with text_reader.open_log(path) as log:
        log.sample()
        sample = propose_signals(log, survey_log(log))
    assert sample.survey.contents["v_GPS"].samples < 0.25 * len(record)
    assert sample.signals_toml == whole.signals_toml
    assert "sign = -1" in sample.signals_toml
    (question,) = sample.proposal.findings  # the steering, or both gyros
    assert question.fault is Fault.SWAPPED_SIGN


@pytest.mark.parametrize("late", [0.0, 0.5])
def test_a_long_delay_is_proposed_and_asked(tmp_path: Path, late: float) -> None:
    """It may hide a wrong unit of the speed, or a wrong length."""
    record, trailer = simulate(TRUCK, count=2, rate=50.0), "yaw_rate.semitrailer"
    delayed = np.interp(record.time - late, record.time, record.signals[trailer])
    write_record(record.with_signals({**record.signals, trailer: delayed}), tmp_path / "run.csv")
    proposal = survey_files([tmp_path / "run.csv"], TRUCK).proposal
    questions = [question.signal for question in proposal.questions if question.fault is Fault.TIME_OFFSET]
    assert questions == [trailer] * bool(late)
    assert (proposal.signals.signals[trailer].delay != 0.0) == bool(late)
