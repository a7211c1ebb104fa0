"""What speaks for the map of a record, and that faults show."""

import numpy as np
import pytest

from fifthwheel.data.checks import Fault
from fifthwheel.estimate.time_bases.evidence import signal_evidence
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get

TRUCK = get("cheng_cebon_2011")
RECORD = simulate(TRUCK, count=2, seed=1)
NAME = "yaw_rate.semitrailer"


@pytest.mark.parametrize("vehicle", [None, TRUCK])
def test_right_signals_are_explained(vehicle):
    evidence = signal_evidence(RECORD, vehicle)
    assert set(evidence.channels) | set(evidence.others) == set(RECORD.signals)
    channel = evidence.channels[NAME]
    assert channel.explained > 0.95
    assert channel.inverted < 0.5
    known = np.isfinite(channel.lowest)
    assert (channel.lowest[known] <= channel.predicted[known]).all()
    assert (channel.predicted[known] <= channel.highest[known]).all()
    assert not [finding for finding in evidence.findings if finding.severity == "error"]


def test_faults_show_in_the_evidence():
    """An inverted signal is explained inverted, a late one shows by how much; nothing without a steer angle."""
    inverted = signal_evidence(RECORD.with_signals({NAME: -RECORD.signals[NAME]}), TRUCK)
    assert inverted.channels[NAME].explained < 0.1
    assert inverted.channels[NAME].inverted > 0.95
    assert [f.remedy for f in inverted.findings if f.fault is Fault.SWAPPED_SIGN] == [{"sign": -1}]
    late = np.interp(RECORD.time - 0.35, RECORD.time, RECORD.signals[NAME])
    offset = signal_evidence(RECORD.with_signals({NAME: late}), TRUCK).channels[NAME].offset
    assert offset.offset == pytest.approx(0.35, abs=0.05)
    assert offset.significant
    assert offset.explained > 0.95
    signals = {name: values for name, values in RECORD.signals.items() if not name.startswith("steer")}
    evidence = signal_evidence(type(RECORD)(time=RECORD.time, signals=signals), TRUCK)
    assert not evidence.channels
    assert set(evidence.others) == set(signals)
