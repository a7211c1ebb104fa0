"""What an identification begins with: loads, knowledge, settings from the options of a user, and a note."""

import datetime
import json
import os
from dataclasses import replace
from pathlib import Path

import pytest

import fifthwheel as fw
from fifthwheel.apps.app import runs
from fifthwheel.apps.app.workspace import Workspace
from fifthwheel.apps.workflow.start import Note, chosen_one_stage, identification_settings, starts_of, stated_in
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.options import IdentifyOptions
from fifthwheel.base.spelling import spelled_for
from fifthwheel.estimate.identify import OneStage
from fifthwheel.estimate.identify.unknowns.parameters import estimated_parameters
from tests.estimate.identify.knowledge.conftest import TRUCK, identified


def only(truck, chosen, logs=()):
    """What the identification of logs with one load begins with."""
    (start,) = starts_of(truck, chosen, logs)
    return start


@pytest.fixture(scope="module")
def result():
    return identified(1, trailer="T 17", load="steel")


@pytest.fixture
def kept(result, tmp_path):
    """A file of knowledge without a result."""
    result.knowledge.save(tmp_path / "merged.json")
    return tmp_path / "merged.json"


def test_a_file_of_knowledge_stands_beside_a_vehicle(kept):
    start = only(TRUCK, IdentifyOptions(knowledge=kept))
    assert len(start.knowledge.logs) == 1
    assert (start.occasion.trailer, start.occasion.load) == ("T 17", "steel")
    other = only(TRUCK, IdentifyOptions(knowledge=kept, trailer="T 18", load=("empty",)))
    assert (other.occasion.trailer, other.occasion.load) == ("T 18", "empty")


@pytest.mark.parametrize("of", ["result", "file", "folder"])
def test_another_mass_is_another_load(result, kept, tmp_path, of):
    heavy = TRUCK.replace({"semitrailer.mass": 36e3})
    result.save(tmp_path / "result")
    truck = replace(result, initial_vehicle=heavy) if of == "result" else heavy
    chosen = {"result": {}, "file": {"knowledge": kept}, "folder": {"knowledge": tmp_path / "result"}}[of]
    with pytest.raises(fw.SignalError, match=r"36000 kg, but 33450 kg with the same load in .*: another load"):
        _ = only(truck, IdentifyOptions(**chosen)).earlier
    assert only(truck, IdentifyOptions(load=("heavy",), **chosen)).occasion.load == "heavy"
    assert only(truck, IdentifyOptions(trailer="T 18", **chosen)).occasion.trailer == "T 18"


def test_knowledge_of_another_truck_and_results_without_knowledge_are_refused(result, kept):
    lorry = fw.Vehicle.loads(TRUCK.to_toml().replace('"tractor"', '"lorry"'))
    with pytest.raises(fw.VehicleError, match="lorry: the knowledge is of a truck whose first unit is tractor"):
        only(lorry, IdentifyOptions(knowledge=kept))
    with pytest.raises(fw.SignalError, match=r"the result has none.*identify its logs again"):
        only(replace(result, knowledge=None), IdentifyOptions())
    logs = tuple(replace(log, set_aside="did not converge") for log in result.knowledge.logs)
    for of, reason in ((logs, r" \(run 1 did not converge\)"), ((), "")):
        fw.Knowledge(logs=of).save(kept)
        with pytest.raises(fw.SignalError, match=f"knowledge: no log that is used{reason}; identify one"):
            only(TRUCK, IdentifyOptions(knowledge=kept))


def test_the_date_is_that_of_the_file(tmp_path):
    file = tmp_path / "run.csv"
    assert only(TRUCK, IdentifyOptions(), [file]).occasion.date is None  # reading the file says that it does not exist
    file.touch()
    os.utime(file, (1e9, 1e9))
    date = datetime.datetime.fromtimestamp(1e9, datetime.UTC)
    assert only(TRUCK, IdentifyOptions(), [file]).occasion.date == date


LOGS = [Path("empty.csv"), Path("laden.csv"), Path("half.csv")]


def test_each_load_has_its_vehicle_and_the_last_log_ends():
    starts = starts_of(TRUCK, IdentifyOptions(load=("empty.csv=0t", "half=10 t")), LOGS)
    expected = [((LOGS[1],), ""), ((LOGS[0],), "0t"), ((LOGS[2],), "10 t")]
    assert [(start.logs, start.occasion.load) for start in starts] == expected
    masses = [start.vehicle.parameters()["semitrailer.mass"] for start in starts]
    assert masses == pytest.approx([33450, 33450 - 20122, 33450 - 10122])
    assert starts[1].folder == "load_0t"


def test_a_vehicle_file_of_a_load(tmp_path):
    fw.with_payload(TRUCK, 5e3).save(tmp_path / "light.toml")
    start = only(TRUCK, IdentifyOptions(load=(str(tmp_path / "light.toml"),)), LOGS[:1])
    assert start.vehicle.parameters()["semitrailer.payload.mass"] == pytest.approx(5e3)


def test_loads_that_are_refused():
    for options, message in (
        ({"load": ("run.csv=0t",)}, r'load="run\.csv=0t"\): no log run\.csv'),
        ({"load": ("steel", "wood")}, r'load="wood"\): steel is the load of all logs already'),
        ({"method": "two-stage", "load": ("empty.csv=0t",)}, r'load=...\): needs method="one_stage"'),
    ):
        with pytest.raises(FifthwheelError, match=message):
            starts_of(TRUCK, IdentifyOptions(**options), LOGS)


def chosen(**choices):
    """Vehicle and settings of the options."""
    return chosen_one_stage(TRUCK, IdentifyOptions(**choices))


def test_a_fraction_is_a_stated_sigma():
    assert chosen() == (TRUCK, OneStage())
    vehicle, settings = chosen(statements=("semitrailer.roll_stiffness=+- 20 %",))
    assert vehicle.stated == {"semitrailer.roll_stiffness": pytest.approx(0.2 * 2.7e6)}
    assert settings == OneStage(given={"semitrailer.roll_stiffness": "+- 20 %"})
    vehicle, settings = chosen(statements=("semitrailer.roll_stiffness=exact",))
    assert vehicle.stated == {"semitrailer.roll_stiffness": 0.0}
    assert settings.given == {"semitrailer.roll_stiffness": "exact"}


def test_a_file_of_statements(tmp_path):
    """A later option on the same number disagrees; the path of a number may be a table."""
    file = tmp_path / "known.toml"
    file.write_text(
        '[given]\n"steer.*.delay" = "+- 5 ms"\nsemitrailer.roll_stiffness = "+- 20 %"\nroad.friction = 0.6\n'
    )
    assert stated_in((f"@{file}", "road.bank=+- 1 deg")) == {
        "steer.*.delay": "+- 5 ms",
        "semitrailer.roll_stiffness": "+- 20 %",
        "road.friction": 0.6,
        "road.bank": "+- 1 deg",
    }
    with pytest.raises(FifthwheelError, match=r"semitrailer\.roll_stiffness: expected one statement, got"):
        stated_in((f"@{file}", "semitrailer.roll_stiffness=+- 10 %"))


def test_statements_that_are_refused(tmp_path):
    file = tmp_path / "known.toml"
    for content, message in (
        ("", r"known\.toml: expected a table \[given\]"),
        ("given = 3", r"known\.toml: expected a table \[given\]"),
        ("[given]\nmass = [1]", r"known\.toml: mass: expected a text such as '\+- 5 %', or a number in SI, got \[1\]"),
        ("[given]\nmass = true", r"known\.toml: mass: expected a text"),
        ("[given]\nmass = nan", r"mass: expected a finite number"),
        ("[given", r"known\.toml: "),
    ):
        file.write_text(content)
        with pytest.raises(FifthwheelError, match=message):
            stated_in((f"@{file}",))
    with pytest.raises(FifthwheelError, match=r"missing\.toml: cannot be read"):
        stated_in((f"@{tmp_path / 'missing.toml'}",))
    for statement, message in (("steer_lag=+- 0.1 s", "steer_lag"), ("tractor.colour=exact", r"tractor\.colour")):
        with pytest.raises(FifthwheelError, match=message):
            chosen(statements=(statement,))


def test_free_parameters_are_estimated_in_addition_to_the_usual_ones():
    statements = ("tractor.yaw_inertia=free", "semitrailer.payload.height=exact")
    vehicle, settings = chosen(statements=statements, tyres="linear", check=False)
    tyres = [f"{group}.cornering_stiffness" for group in ("tractor.front", "tractor.drive", "semitrailer")]
    assert estimated_parameters(vehicle, settings) == [*tyres, "semitrailer.yaw_inertia", "tractor.yaw_inertia"]
    assert not settings.check


def test_any_load_estimates_the_laden_body():
    vehicle, settings = chosen(statements=("tractor.yaw_inertia=free",), any_load=True)
    assert not settings.uniform_payload
    estimated = estimated_parameters(vehicle, settings)
    assert {"semitrailer.sprung.cog_height", "semitrailer.sprung.roll_inertia", "tractor.yaw_inertia"} < {*estimated}
    assert "semitrailer.payload.height" not in estimated


def test_the_article_keeps_its_own_statements():
    options = IdentifyOptions(method="article", statements=("tractor.front.cornering_stiffness=exact",))
    _, settings = identification_settings(TRUCK, options)
    assert settings.given == {"sensors": "exact", "tractor.front.cornering_stiffness": "exact"}


@pytest.mark.parametrize(
    "wrong",
    [
        {"statements": ("softening=exact",), "tyres": "saturating"},
        {"statements": ("road.friction=wet",), "tyres": "linear"},
        {"passes": 3},
        {"tyres": "linear", "method": "two-stage"},
        {"load": ("a", "b")},
    ],
)
def test_a_refused_setting_is_named_in_the_words_of_the_front_end(wrong):
    for words, mark in (("command line", "--"), ("workbench", "“")):
        with spelled_for(words), pytest.raises(FifthwheelError, match=mark):
            starts_of(TRUCK, IdentifyOptions(**wrong))


def test_the_list_of_results_has_the_notes(tmp_path: Path) -> None:
    note = {"text": "New <tyres>, 8 bar", "author": "A. Driver", "date": "2026-01-02"}
    (tmp_path / "runs" / "first").mkdir(parents=True)
    (tmp_path / "runs" / "first" / "identification.json").write_text(json.dumps({"note": note}))
    assert runs.labels(Workspace(tmp_path)) == {"first": "first: New <tyres>, 8 bar (A. Driver, 2026-01-02)"}
    assert Note.of(IdentifyOptions()) is None
    for text in ("{}", "[]", "no JSON", '{"note": null}', '{"note": 3}'):
        (tmp_path / "identification.json").write_text(text)
        assert Note.read(tmp_path / "identification.json") is None
    assert Note.read(tmp_path / "missing.json") is None
