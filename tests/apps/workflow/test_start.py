"""What an identification begins with: knowledge, trailer, load and date."""

import datetime
import os
from dataclasses import replace
from pathlib import Path

import pytest

import fifthwheel as fw
from fifthwheel.apps.workflow.start import starts_of
from fifthwheel.base.options import IdentifyOptions
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


def test_another_truck_is_refused(kept):
    lorry = fw.Vehicle.loads(TRUCK.to_toml().replace('"tractor"', '"lorry"'))
    with pytest.raises(fw.VehicleError, match="lorry: the knowledge is of a truck whose first unit is tractor"):
        only(lorry, IdentifyOptions(knowledge=kept))


def test_a_result_without_knowledge_is_refused(result):
    with pytest.raises(fw.SignalError, match=r"the result has none.*identify its logs again"):
        only(replace(result, knowledge=None), IdentifyOptions())


def test_knowledge_without_a_log_that_is_used_is_refused(result, tmp_path):
    logs = tuple(replace(log, set_aside="did not converge") for log in result.knowledge.logs)
    for of, reason in ((logs, r" \(run 1 did not converge\)"), ((), "")):
        fw.Knowledge(logs=of).save(tmp_path / "merged.json")
        with pytest.raises(fw.SignalError, match=f"knowledge: no log that is used{reason}; identify one"):
            only(TRUCK, IdentifyOptions(knowledge=tmp_path / "merged.json"))


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
    assert [(start.logs, start.occasion.load) for start in starts] == [
        ((LOGS[1],), ""),
        ((LOGS[0],), "0t"),
        ((LOGS[2],), "10 t"),
    ]
    masses = [start.vehicle.parameters()["semitrailer.mass"] for start in starts]
    assert masses == pytest.approx([33450, 33450 - 20122, 33450 - 10122])
    assert starts[1].folder == "load_0t"


def test_a_vehicle_file_of_a_load(tmp_path):
    fw.with_payload(TRUCK, 5e3).save(tmp_path / "light.toml")
    start = only(TRUCK, IdentifyOptions(load=(str(tmp_path / "light.toml"),)), LOGS[:1])
    assert start.vehicle.parameters()["semitrailer.payload.mass"] == pytest.approx(5e3)


@pytest.mark.parametrize(
    ("loads", "message"),
    [
        (("run.csv=0t",), r'load="run\.csv=0t"\): no log run\.csv'),
        (("steel", "wood"), r'load="wood"\): steel is the load of all logs already'),
    ],
)
def test_loads_that_are_refused(loads, message):
    with pytest.raises(fw.SignalError, match=message):
        starts_of(TRUCK, IdentifyOptions(load=loads), LOGS)


def test_two_stages_have_one_load():
    with pytest.raises(fw.FifthwheelError, match=r'load=...\): needs method="one_stage"'):
        starts_of(TRUCK, IdentifyOptions(method="two-stage", load=("empty.csv=0t",)), LOGS)
