"""Logs that contradict each other: a bad log is set aside, also if it is the first."""

import datetime
from collections.abc import Sequence

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.estimate.identify.doubts import Cause, Doubt, DoubtKind
from fifthwheel.estimate.identify.knowledge.knowledge import LogChange
from fifthwheel.estimate.identify.one_stage import identify as method
from fifthwheel.estimate.identify.one_stage.prior import JointPrior
from fifthwheel.results.diagnose.doubt_cautions import contradiction_cautions

TRUCK = fw.vehicle("cheng_cebon_2011")
STEER = "steer.tractor.front"
DATE = datetime.datetime(2026, 1, 1, tzinfo=datetime.UTC)
SETTINGS = fw.OneStage(given={"steer.*.delay": "+- 20 ms"}, tyres="linear")


def record(k: int, *, late: float = 0.0, trailer: bool = False) -> fw.Record:
    """Log k: a lane change, with a steer angle that is late, or with another trailer."""
    p = TRUCK.parameters()
    light = {f"semitrailer.{name}": p[f"semitrailer.{name}"] - 13e3 for name in ("mass", "payload.mass")}
    truck = TRUCK.replace(light | {"semitrailer.yaw_inertia": 0.5 * p["semitrailer.yaw_inertia"]}) if trailer else TRUCK
    made = fw.simulate(truck, count=1, seed=k, speed=18.0 + k)
    signals = {**made.signals, STEER: np.interp(made.time - late, made.time, made.signals[STEER])}
    return fw.Record(time=made.time, signals=signals, name=f"log {k}")


def identified(records: Sequence[fw.Record]) -> fw.Identification:
    """One after another, one an hour."""
    result = None
    for k, log in enumerate(records):
        occasion = fw.Occasion(date=DATE + datetime.timedelta(hours=k))
        knowledge = result.knowledge if result else None
        result = fw.identify([log], TRUCK, SETTINGS, knowledge=knowledge, occasion=occasion)
    assert result
    return result


def states(result: fw.Identification) -> str:
    """Set aside (A), changed (C) or used (.), of each log."""
    return "".join("A" if log.set_aside else "C" if log.changed else "." for log in result.knowledge.logs)


@pytest.mark.slow
def test_a_bad_log_is_set_aside() -> None:
    """A late steer angle is not explained by other tyres: with these, the log contradicts the earlier ones, too."""
    bad = identified([record(0), record(1), record(2, late=0.25)])
    assert states(bad) == "..A"
    assert "It is set aside" in " ".join(map(str, contradiction_cautions(bad)))


@pytest.mark.slow
def test_a_bad_first_log_is_set_aside_by_two_others() -> None:
    """Of two logs that differ, the second is set aside; the third decides."""
    result = identified([record(k, trailer=k == 0) for k in range(3)])
    assert states(result) == "A.."
    assert "log 0: contradicts the logs after it, and is set aside." in " ".join(result.notes)
    for name in ("semitrailer.cornering_stiffness", "semitrailer.yaw_inertia"):
        estimate = result[name]
        assert abs(estimate.value - TRUCK.parameters()[name]) < 3 * estimate.sigma


def test_an_earlier_log_that_later_logs_contradict_is_set_aside(logs) -> None:
    """A change at an earlier log, which only later logs show, belongs to this one."""
    known, second = fw.Knowledge(logs=logs[:2]), logs[1]
    outlier = known.with_changes([LogChange(kind="outlier", unknowns=(), text="", log=second.digest)])
    assert [bool(log.set_aside) for log in outlier.logs] == [False, True]
    name = "semitrailer.cornering_stiffness"
    tyres = known.with_changes([LogChange(kind="tyres", unknowns=(name,), text="", log=second.digest)])
    assert [log.changed for log in tyres.logs] == [(), (name,)]


def doubt_of(kind: DoubtKind, *names: str) -> Doubt:
    causes = tuple(Cause(name=name, changes={}, prior_sigmas=4.0) for name in names)
    return Doubt(kind=kind, causes=causes, parameters=(), statistic=4.0)


@pytest.mark.parametrize(
    ("doubts", "expected"),
    [
        ([], False),
        ([doubt_of(DoubtKind.ASSUMPTION, "mass")], True),
        ([doubt_of(DoubtKind.ESTIMATE, "rear")], True),
        ([doubt_of(DoubtKind.ESTIMATE, "front")], False),  # it was unusual before
        ([doubt_of(DoubtKind.ESTIMATE, "inertia")], False),  # it has not changed
        ([doubt_of(DoubtKind.RANGE), doubt_of(DoubtKind.ESTIMATE, "inertia", "new")], True),
    ],
)
def test_a_log_contradicts_earlier_ones_although_tyres_changed(monkeypatch, doubts, expected) -> None:
    monkeypatch.setattr(method, "quick_doubts", lambda _: doubts)
    names, mean = ("front", "rear", "inertia"), np.array([-2.5, 2.499, 0.0])
    before = JointPrior(names=names, mean=mean, covariance=np.eye(3), widening=np.ones(3))
    assert method._is_contradicted(None, before, {"front", "rear", "new"}) == expected
    if not any(c.name == "front" for doubt in doubts for c in doubt.causes):
        assert method._is_contradicted(None, None, {"front", "rear", "new"}) == expected
