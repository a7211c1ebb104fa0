"""The corruptions and the judgement of the benchmark benchmarks/trust.py."""

import sys
from pathlib import Path

import numpy as np
import pytest

from fifthwheel.plant import Properties
from fifthwheel.plant.properties import with_changes
from fifthwheel.record import Record
from fifthwheel.simulate import simulate

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))
import trust
from trust_corruptions import CORRUPTIONS, Corruption
from trust_runs import TRUCK


def excited_record() -> Record:
    """A short log with large rates and a varying speed, so that each corruption alters it."""
    record = simulate(TRUCK, count=1)
    signals = {name: 4 * values for name, values in record.signals.items()}
    signals["speed"] = 20 + np.sin(record.time)
    return record.with_signals(signals)


RECORD = excited_record()
OF_LOGS = [c for c in CORRUPTIONS.values() if not c.category.startswith("file")]


def test_number_of_corruptions() -> None:
    assert len(OF_LOGS) >= 150
    assert len(CORRUPTIONS) - len(OF_LOGS) >= 40


@pytest.mark.parametrize("corruption", CORRUPTIONS.values(), ids=CORRUPTIONS)
def test_corruption_alters_one_input(corruption: Corruption) -> None:
    record, vehicle = corruption.record(RECORD), corruption.vehicle(TRUCK)
    runs = [with_changes(Properties(), dict(changes)) for changes in corruption.runs]
    altered = [record != RECORD, vehicle != TRUCK, runs != [Properties()]]
    assert altered.count(True) == 1
    assert altered[1] == corruption.category.startswith("file")
    assert corruption.words
    assert len(record) == len(RECORD)


def test_corruptions_are_reproducible() -> None:
    for corruption in OF_LOGS:
        assert corruption.record(RECORD) == corruption.record(RECORD)


CONVERGED = trust.Wrong(name="a", error=0.3, sigma=0.05, z=6.0, verdict="converged")
DOUBTFUL = trust.Wrong(name="b", error=0.3, sigma=0.05, z=6.0, verdict="doubtful")
LATE = CORRUPTIONS["trailer gyros 0.1 s late"]


@pytest.mark.parametrize(
    ("wrong", "messages", "expected"),
    [
        ((), ("yaw_rate.semitrailer: noisy",), "within"),
        ((CONVERGED,), (), "silent"),
        ((CONVERGED, DOUBTFUL), ("speed: noisy",), "silent"),
        ((CONVERGED,), ("Check the Latency.",), "flagged"),
        ((DOUBTFUL,), (), "flagged"),
    ],
)
def test_outcome(wrong: tuple[trust.Wrong, ...], messages: tuple[str, ...], expected: str) -> None:
    assert trust.outcome_of(LATE, wrong, messages) == expected


def test_numbers_of_a_message_do_not_count() -> None:
    assert trust.without_numbers("delay is 0.01 s ± 2 ms") == trust.without_numbers("delay is 1.2 s ± 30 ms")
