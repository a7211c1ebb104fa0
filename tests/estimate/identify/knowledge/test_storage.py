"""knowledge.json: equal after reading, and refused with a reason when another hand has changed it."""

import copy
import json
from pathlib import Path

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.estimate.identify.knowledge.storage import FILE


@pytest.fixture
def file(knowledge, tmp_path) -> Path:
    knowledge.save(tmp_path / "knowledge.json")
    return tmp_path / "knowledge.json"


@pytest.fixture
def changed(file):
    """Write the file with a changed content and a digest that fits, and load it."""
    content = json.loads(file.read_text())["content"]

    def load(change):
        own = copy.deepcopy(content)
        change(own)
        FILE.write(file, own)
        return fw.Knowledge.load(file)

    return load


def test_a_file_is_read_as_it_was_written(file, knowledge):
    for path in (file, file.parent, file.with_name("identification.json")):
        read = fw.Knowledge.load(path)
        for own, other in zip(knowledge.logs, read.logs, strict=True):
            for name in ("name", "date", "tractor", "trailer", "load", "digest", "estimated", "doubts", "masses"):
                assert getattr(own, name) == getattr(other, name), name
        np.testing.assert_array_equal(read.combined.z[-1], knowledge.combined.z[-1])


def set_log(key, value):
    return lambda content: content["logs"][0].update({key: value})


def set_unknown(key, value):
    return lambda content: content["logs"][0]["information"][key].__setitem__(0, value)


def set_information(key, value):
    return lambda content: content["logs"][0]["information"].update({key: value})


def duplicate(content):
    names = content["logs"][0]["information"]["names"]
    names[1] = names[0]


def huge(content):
    content["logs"][0]["information"]["names"] *= 100


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda content: content.pop("logs"), "a valid tuple"),
        (lambda content: content["logs"][0].pop("tractor"), "0.tractor: Field required"),
        (lambda content: content.update(logs=["x"]), "not what"),
        (set_log("name", 3), "0.name: Input should be a valid string"),
        (set_log("date", "2026-01-01"), "time zone"),
        (set_log("date", "9999-12-31T23:59:59-14:00"), "time zone"),
        (set_log("masses", {"semitrailer.mass": "heavy"}), "semitrailer.mass: Input should be a valid number"),
        (set_information("information", [1.0]), "a matrix of 1 rows"),
        (set_information("information", [1.0, 1.0]), "a symmetric matrix of 2 numbers"),
        (set_information("vector", [1.0]), "columns of other lengths"),
        (set_unknown("scale", 0), "positive scale"),
        (set_unknown("centre", -1.0), "positive scale or median"),
        (set_unknown("centre", 1e200), "less than or equal to 10{40}"),
        (set_unknown("vector", True), "information.vector.0: Input should be a valid number"),
        (set_unknown("information", -1e6), "not positive semidefinite"),
        (duplicate, "two unknowns of one name"),
        (huge, "at most 500"),
    ],
)
def test_impossible_content_is_refused_with_the_reason(changed, change, reason):
    with pytest.raises(fw.SignalError, match=reason) as refused:
        changed(change)
    assert "identify the logs again" in str(refused.value)
    assert "knowledge.json" in str(refused.value)


def test_other_files_are_refused(tmp_path):
    head = '{"format": "fifthwheel knowledge 1", '
    for text, reason in (
        ("", "not a JSON file"),
        ("[]", "not a file of the knowledge of a truck"),
        ('{"format": "fifthwheel knowledge 99"}', "another version"),
        (head + '"digest": "", "content": {"logs": [NaN]}}', "damaged"),
        (head + '"content": {"logs": [NaN]}}', "damaged"),
        (head + '"digest": "0", "content": {"logs": []}}', "damaged"),
    ):
        (tmp_path / "knowledge.json").write_text(text)
        with pytest.raises(fw.SignalError, match=reason):
            fw.Knowledge.load(tmp_path)
    (tmp_path / "knowledge.json").unlink()
    (tmp_path / "identification.json").write_text("{}")
    with pytest.raises(fw.SignalError, match=r"has no knowledge, .*; identify its logs again in one stage"):
        fw.Knowledge.load(tmp_path)
