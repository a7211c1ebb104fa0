"""Knowledge as tables, logs that are forgotten, and knowledge that is merged."""

from dataclasses import replace

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.estimate.identify.knowledge.history import changes_in_words, history, shared_estimates
from tests.estimate.identify.knowledge.conftest import FRONT, REAR, identified, moved


@pytest.mark.slow
def test_every_estimate_has_its_owner_and_its_last_log(knowledge):
    found = {(e.name, e.owner.get("trailer")): e for e in shared_estimates(knowledge)}
    front = found[FRONT, None]
    assert (front.belongs_to, front.log, front.unit, front.estimated) == ("truck", "run 3", "N/rad", True)
    assert front.sigma == pytest.approx(knowledge.combined.estimate(2, knowledge.combined.parameters(2)[0])[1])
    assert found[REAR, ""].belongs_to == "trailer"
    assert (found[REAR, ""].log, found[REAR, "T 17"].log) == ("run 2", "run 3")
    assert found[REAR, "T 17"].belongs_to == "trailer T 17"
    inertia = found["semitrailer.yaw_inertia", "T 17"]
    assert inertia.belongs_to == "load steel of trailer T 17"
    assert found["semitrailer.yaw_inertia", ""].belongs_to == "load"


def test_the_history_has_sigma_before_and_after_each_log(knowledge):
    first, second, third = history(knowledge)
    assert [e.log.name for e in (first, second, third)] == ["run 1", "run 2", "run 3"]
    before, after = first.sigmas[FRONT]
    assert before == pytest.approx(0.3 * 475e3, rel=0.2)  # that of the prior
    assert after < before / 3
    walk = 0.005 * 475e3  # in a day
    assert second.sigmas[FRONT][0] == pytest.approx(np.hypot(after, walk), rel=0.05)
    assert third.sigmas[FRONT][1] < second.sigmas[FRONT][1] < after
    assert third.sigmas[REAR][0] > 3 * second.sigmas[REAR][1]  # another trailer
    last = next(e for e in shared_estimates(knowledge) if e.name == FRONT)
    assert third.sigmas[FRONT][1] == pytest.approx(last.sigma)
    assert first.as_dict()["added"][0]["sigma_before"] == before


def test_changes_and_unused_logs_are_in_the_history(logs):
    first, second, third = logs
    new_tyres = replace(second, changed=(FRONT,), doubts=("contradicted assumption: x",))
    aside = replace(third, set_aside="contradicts the earlier logs")
    entries = history(fw.Knowledge(logs=(aside, first, new_tyres)))
    assert [e.changes for e in entries] == [(), ("tyres of tractor.front changed",), ()]
    assert [e.unused for e in entries] == ["", "", "contradicts the earlier logs"]
    before, after = entries[1].sigmas[FRONT]
    assert before == pytest.approx(entries[0].sigmas[FRONT][0], rel=0.2)  # the prior again
    assert entries[1].as_dict()["doubts"] == ["contradicted assumption: x"]
    assert after < before


def test_changes_in_words(logs):
    inertia, height = "semitrailer.yaw_inertia", "semitrailer.payload.height"
    for changed, words in (
        (("yaw_rate.tractor.gain", "yaw_rate.tractor.delay"), ["sensor yaw_rate.tractor changed"]),
        ((REAR,), ["tyres of semitrailer changed"]),
        ((inertia, REAR, height), ["load of T 17 changed"]),
        ((height, FRONT), ["load of T 17 changed", "tyres of tractor.front changed"]),
    ):
        assert list(dict.fromkeys(changes_in_words(replace(logs[2], changed=changed)))) == words


def test_a_log_that_is_forgotten(knowledge, logs):
    """What the others told is left; it is named in one way."""
    left, alone = knowledge.without("run 2"), fw.Knowledge(logs=(logs[0], logs[2]))
    assert [log.name for log in left.logs] == ["run 1", "run 3"]
    np.testing.assert_array_equal(left.combined.z[-1], alone.combined.z[-1])
    with pytest.raises(fw.SignalError, match=r"rum 2: no such log; did you mean 'run 2'"):
        knowledge.without("rum 2")
    twins = fw.Knowledge(logs=(replace(logs[0], name="run 2"), *logs[1:]))
    digests = f"{logs[0].digest[:12]} or {logs[1].digest[:12]}"
    with pytest.raises(fw.SignalError, match=f"2 logs have this name; give the beginning of a digest: {digests}"):
        twins.without("run 2")
    assert len(knowledge.without(logs[1].digest[:12]).logs) == 2
    with pytest.raises(fw.SignalError, match="the last log"):
        fw.Knowledge(logs=logs[:1]).without("run 1")


def test_a_log_that_contradicts_only_the_forgotten_one_is_used_again(logs):
    first, second, _ = logs
    wrong = moved(first, 6.0, "wrong")
    aside = [replace(log, set_aside="contradicts the earlier logs") for log in (first, second)]
    left = fw.Knowledge(logs=(wrong, *aside)).without("wrong")
    assert [(log.name, log.set_aside) for log in left.logs] == [("run 1", ""), ("run 2", "")]


def test_merged_knowledge_counts_a_log_once(logs):
    first, second, third = logs
    merged = fw.Knowledge(logs=(first, second)).merged(fw.Knowledge(logs=(second, third)))
    assert [log.name for log in merged.logs] == ["run 1", "run 2", "run 3"]
    other = fw.Knowledge(logs=(replace(third, tractor="lorry"),))
    with pytest.raises(fw.SignalError, match="lorry: the first unit of another truck than tractor; merge results"):
        merged.merged(other)
    with pytest.raises(fw.VehicleError, match="tractor: the knowledge is of a truck whose first unit is lorry"):
        identified(4, other)


def test_a_log_begins_with_trailer_and_load_of_the_last_log(knowledge):
    """Of this truck, and with this trailer, if one is named."""
    truck = fw.vehicle("cheng_cebon_2011")
    lorry = fw.Vehicle.loads(truck.to_toml().replace('"tractor"', '"lorry"'))
    cases = [(truck, None), (truck, "T 17"), (truck, ""), (truck, "T 18"), (lorry, None)]
    found = [knowledge.occasion(vehicle, trailer) for vehicle, trailer in cases]
    expected = [("T 17", "steel"), ("T 17", "steel"), ("", ""), ("T 18", ""), ("", "")]
    assert [(occasion.trailer, occasion.load) for occasion in found] == expected


@pytest.mark.slow
def test_doubts_are_kept_and_named_by_later_results(logs):
    truck, steer = fw.vehicle("cheng_cebon_2011"), "steer.tractor.front"

    def late(seed):
        record = fw.simulate(truck, count=1, seed=seed, name=f"run {seed}")
        return record.with_signals({steer: np.interp(record.time - 0.25, record.time, record.signals[steer])})

    settings = fw.OneStage(given={"truck": "exact"}, tyres="linear")
    first = fw.identify([late(1)], truck, settings)
    (log,) = first.knowledge.logs
    assert first.doubts
    assert len(log.doubts) == len(first.doubts)
    assert log.doubts[0].startswith("contradicted assumption: steer.tractor.front.delay (+")
    later = fw.identify([late(2)], truck, settings, knowledge=first.knowledge)
    assert any(f"run 1 is doubtful ({log.doubts[0]})" in note for note in later.notes)
    assert not any("doubtful" in note for note in identified(4, fw.Knowledge(logs=logs[:1])).notes)
