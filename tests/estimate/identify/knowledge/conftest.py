"""The knowledge from short logs of one parameter, which take little time."""

import datetime
from dataclasses import replace

import pytest

import fifthwheel as fw
from fifthwheel.estimate.identify.knowledge.information import LogKnowledge

TRUCK = fw.vehicle("cheng_cebon_2011")
FRONT = "tractor.front.cornering_stiffness"
REAR = "semitrailer.cornering_stiffness"
ESTIMATED = dict.fromkeys((FRONT, REAR, "semitrailer.yaw_inertia"), "free")
SETTINGS = fw.OneStage(given={"truck": "exact", **ESTIMATED}, tyres="linear")
DAY = datetime.datetime(2026, 1, 1, tzinfo=datetime.UTC)


def identified(seed: int, knowledge: fw.Knowledge | None = None, **occasion: str) -> fw.Identification:
    """The result of a log on the day of its number."""
    return fw.identify(
        [fw.simulate(TRUCK, count=1, seed=seed, name=f"run {seed}")],
        TRUCK,
        SETTINGS,
        knowledge=knowledge,
        occasion=fw.Occasion(date=DAY + datetime.timedelta(days=seed), **occasion),
    )


@pytest.fixture(scope="session")
def logs() -> tuple[LogKnowledge, ...]:
    """Three logs, the last with another trailer."""
    first, second = (identified(seed).knowledge.logs[0] for seed in (1, 2))
    return first, second, identified(3, trailer="T 17", load="steel").knowledge.logs[0]


@pytest.fixture
def knowledge(logs: tuple[LogKnowledge, ...]) -> fw.Knowledge:
    return fw.Knowledge(logs=logs)


def moved(log: LogKnowledge, z: float, name: str) -> LogKnowledge:
    """A log like this one whose estimates differ by z prior standard deviations in all unknowns."""
    own = log.information
    shifted = replace(own, vector=own.vector + own.information.sum(axis=1) * z)
    return replace(log, name=name, digest=name * 12, information=shifted, date=log.date + datetime.timedelta(hours=1))
