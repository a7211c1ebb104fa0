"""The runs as functions of data: what they return and write, estimators for export, and surveys of logs."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet

from fifthwheel.apps.workflow.inputs import propose_signals, read_records, read_vehicle, survey_file
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


@pytest.mark.slow
def test_a_conclusion_with_remedies(run):
    """The payload height is uncertain, so remedies are predicted at the identified vehicle."""
    assert run.outlook is not None
    assert run.outlook["semitrailer.payload.height"].remedies
    assert run.as_dict()["conclusion"] == run.conclusion.as_dict()
    assert "other" in " ".join(run.conclusion.results)


@pytest.mark.slow
def test_no_remedies_where_all_is_known():
    exact = run_identification([simulate(TRUCK, count=6)], TRUCK, FIVE)
    assert {e.verdict for e in exact.identification.parameters} == {"converged"}
    assert exact.outlook is None


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
    files = write_results(run, tmp_path)
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
def test_the_report_has_the_name_of_the_result(run, tmp_path):
    write_results(run, tmp_path, name="bend <1>")
    page = (tmp_path / "report.html").read_text()
    assert f"<title>{TRUCK.name}, bend &lt;1&gt;: fifthwheel</title>" in page
    assert f'<h1>{TRUCK.name}<span class="result">, bend &lt;1&gt;</span></h1>' in page


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
    (tmp_path / "states").mkdir()
    assert set(write_results(states, tmp_path / "states")) == {"states.json", "states.parquet", "report.html"}


@pytest.mark.slow
def test_states_of_a_log_without_information_on_its_sensors(run, contents, tmp_path):
    (tmp_path / "identification.json").write_text(contents)
    stored = Identification.load(tmp_path / "identification.json")
    slow = OTHER.with_signals({"speed": np.ones(len(OTHER))})
    states = run_states([slow], run.identification.vehicle, identification=stored, check=False)
    assert states.notes[0].startswith("other: not a log of the identification; its sensor errors are unknown")


def test_states_alone():
    settings = ObserverSettings(min_speed=30.0)
    states = run_states([RUN], TRUCK, settings, smooth=True)
    assert (states.smoothed, states.uncertain, states.notes) == (True, (), ())
    assert states.as_dict()["logs"][0]["status"]["too_slow"] == 1.0
    inverted = RUN.with_signals({"yaw_rate.tractor": -RUN.signals["yaw_rate.tractor"]})
    with pytest.raises(SignalError, match=r"^yaw_rate\.tractor: "):
        run_states([inverted], TRUCK)
    assert run_states([inverted], TRUCK, check=False).states


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{}", '{"sensors": []}', '{"sensors": [], "logs": []}', '{"sensors": [], "logs": [{"name": "a"}]}', "3"],
)
def test_another_file_than_identification_json_is_refused(text, tmp_path):
    path = tmp_path / "identification.json"
    path.write_text(text)
    with pytest.raises(
        SignalError, match=r"identification\.json: not an? (identification\.json|JSON file).*; .* `fifthwheel identify`"
    ):
        Identification.load(path)


def test_records_of_the_same_stem_have_distinct_names(tmp_path):
    paths = [tmp_path / "a" / "run.csv", tmp_path / "b" / "run.csv", tmp_path / "c.csv"]
    for path in paths:
        path.parent.mkdir(exist_ok=True)
        write_record(OTHER, path)
    calls = []
    records = read_records(paths, progress=lambda *call: calls.append(call))
    assert [record.name for record in records] == [str(paths[0]), str(paths[1]), "c"]
    assert calls[-1] == ("reading c.csv", 1000, 1000)


def test_a_vehicle_by_name_or_file(tmp_path):
    TRUCK.save(tmp_path / "truck.toml")
    assert read_vehicle("cheng_cebon_2011") == read_vehicle(str(tmp_path / "truck.toml")) == TRUCK
    with pytest.raises(VehicleError, match=r"lorry: no such file, and not in the catalogue, which has .*cheng"):
        read_vehicle("lorry")


@pytest.mark.slow
@pytest.mark.parametrize("value", [math.nan, None, math.inf, "0.1"], ids=str)
@pytest.mark.parametrize("place", ["sensor error", "sensor error of a log", "noise"])
def test_a_stored_value_that_is_not_a_number_is_refused(contents, tmp_path, value, place):
    """It made all states NaN with the status OK."""
    path = tmp_path / "identification.json"
    contents = json.loads(contents)
    name = "yaw_rate.tractor" if place == "noise" else "yaw_rate.tractor.offset"
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
def test_a_learner_of_an_identification(result: Identification) -> None:
    live = exported_learner(result.vehicle, None, result, min_speed=7.0, passes=2, segment=300).live
    assert {*live.setup.inputs, *live.setup.outputs} == set(result.signals)
    assert live.setup.settings == replace(FIVE, min_speed=7.0)
    assert (live.learner.relinearisation.max_passes, live.learner.relinearisation.samples) == (2, 300)


@pytest.mark.slow
def test_a_misspelled_signal_of_a_learner_is_refused(result: Identification) -> None:
    signals = [*result.signals, "yaw_rate.semitrailr"]
    with pytest.raises(SignalError, match=r"yaw_rate\.semitrailr: no signal that a learner .*did you mean"):
        exported_learner(TRUCK, signals, result)


def test_default_signals() -> None:
    observer = exported_observer(TRUCK, options=ObserverOptions(min_speed=7.0, friction=0.3, half_track=0.92))
    assert (observer.settings.friction, observer.settings.half_track) == (0.3, 0.92)
    assert observer.inputs == ("speed", *TRUCK.steer_signals())
    assert len(observer.outputs) == 4
    assert observer.settings.min_speed == 7.0


@pytest.mark.slow
def test_an_observer_of_an_identification(result: Identification) -> None:
    observer = exported_observer(result.vehicle, None, result)
    assert {*observer.inputs, *observer.outputs} == set(result.signals)
    assert observer.settings == result.observer_settings()
    with pytest.raises(VehicleError, match=r"auburn.*not those of the identification.*vehicle\.toml"):
        exported_observer(get("auburn_6x4"), None, result)


def test_a_misspelled_signal_of_an_observer_is_refused() -> None:
    signals = ["speed", "steer.tractor.front", "yaw_rate.tractor", "yaw_rate.semitrailr"]
    with pytest.raises(SignalError, match=r"yaw_rate\.semitrailr: no signal that an observer .*did you mean"):
        exported_observer(TRUCK, signals)


def test_a_log_without_signals_has_a_survey(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t,a,b\n" + "".join(f"{k / 10},{k},{-k}\n" for k in range(20)))
    contents = survey_file(path)
    assert list(contents.survey.contents) == ["t", "a", "b"]
    assert not contents.proposal.signals.signals
    assert "speed: not found" in contents.signals_toml


@pytest.mark.slow
def test_a_sample_of_a_large_log_gives_the_map_of_the_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The pauses between the parts of the sample are not faults of the log."""
    truck = get("cheng_cebon_2011")
    record = simulate(truck, count=20)
    names = {"v_GPS [m/s]": "speed", "GierSZM [rad/s]": "yaw_rate.tractor", "GierSA [rad/s]": "yaw_rate.semitrailer"}
    columns = [record.time, *(record.signals[name] for name in names.values()), -record.signals["steer.tractor.front"]]
    path = tmp_path / "log.csv"
    np.savetxt(path, np.column_stack(columns), "%.5f", ",", header=",".join(["t", *names, "delta"]), comments="")
    whole = survey_file(path)
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
