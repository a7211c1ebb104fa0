"""What an identification begins with: knowledge, trailer, load and date."""

import datetime
import os
from dataclasses import replace

import pytest

import fifthwheel as fw
from fifthwheel.options import IdentifyOptions
from fifthwheel.workflow import start_of, with_date
from tests.identify.knowledge.conftest import TRUCK, identified


@pytest.fixture(scope="module")
def result():
    return identified(1, trailer="T 17", load="steel")


@pytest.fixture
def kept(result, tmp_path):
    """A file of knowledge without a result."""
    result.knowledge.save(tmp_path / "merged.json")
    return tmp_path / "merged.json"


def test_a_file_of_knowledge_stands_beside_a_vehicle(kept):
    start = start_of(TRUCK, IdentifyOptions(knowledge=kept))
    assert len(start.knowledge.logs) == 1
    assert (start.occasion.trailer, start.occasion.load) == ("T 17", "steel")
    other = start_of(TRUCK, IdentifyOptions(knowledge=kept, trailer="T 18", load="empty"))
    assert (other.occasion.trailer, other.occasion.load) == ("T 18", "empty")


@pytest.mark.parametrize("of", ["result", "file", "folder"])
def test_another_mass_is_another_load(result, kept, tmp_path, of):
    heavy = TRUCK.replace({"semitrailer.mass": 36e3})
    result.save(tmp_path / "result")
    truck = replace(result, initial_vehicle=heavy) if of == "result" else heavy
    chosen = {"result": {}, "file": {"knowledge": kept}, "folder": {"knowledge": tmp_path / "result"}}[of]
    with pytest.raises(fw.SignalError, match="36000 kg, but 33450 kg in the knowledge: another load"):
        start_of(truck, IdentifyOptions(**chosen))
    assert start_of(truck, IdentifyOptions(load="heavy", **chosen)).occasion.load == "heavy"
    assert start_of(truck, IdentifyOptions(trailer="T 18", **chosen)).occasion.trailer == "T 18"


def test_another_truck_is_refused(kept):
    lorry = fw.Vehicle.loads(TRUCK.to_toml().replace('"tractor"', '"lorry"'))
    with pytest.raises(fw.VehicleError, match="lorry: the knowledge is of a truck whose first unit is tractor"):
        start_of(lorry, IdentifyOptions(knowledge=kept))


def test_a_result_without_knowledge_is_refused(result):
    with pytest.raises(fw.SignalError, match=r"the result has none.*identify its logs again"):
        start_of(replace(result, knowledge=None), IdentifyOptions())


def test_the_date_is_that_of_the_file(tmp_path):
    file = tmp_path / "run.csv"
    start = start_of(TRUCK, IdentifyOptions())
    assert with_date(start, file) == start  # reading the file says that it does not exist
    file.touch()
    os.utime(file, (1e9, 1e9))
    assert with_date(start, file).occasion.date == datetime.datetime.fromtimestamp(1e9, datetime.UTC)
