"""Late channels on the command line: `signals` writes their delay, `check` names and draws them."""

import numpy as np
import pytest

from fifthwheel.data.checks import Fault
from fifthwheel.data.logs import SignalMap, read_log, write_record
from fifthwheel.estimate.time_bases import check_signals
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get
from tests.test_faults import run

LATE = ("yaw_rate.semitrailer", "roll_rate.semitrailer")


@pytest.fixture
def log(tmp_path):
    record = simulate(get("cheng_cebon_2011"), count=4)
    shifted = {n: np.interp(record.time - 0.35, record.time, record.signals[n]) for n in LATE}
    write_record(record.with_signals(shifted), tmp_path / "late.csv")
    return tmp_path / "late.csv"


def test_signals_writes_the_delay_that_check_asks_for(log, tmp_path, capsys):
    out = tmp_path / "signals.toml"
    code, _, err = run(capsys, "signals", log, "-v", "cheng_cebon_2011", "-o", out)
    assert (code, err) == (0, "")
    proposed = SignalMap.load(out)
    delays = {name: channel.delay for name, channel in proposed.signals.items() if channel.delay}
    assert delays == {name: pytest.approx(0.35, abs=0.02) for name in LATE}
    findings = check_signals(read_log(log, proposed), get("cheng_cebon_2011"))
    assert Fault.TIME_OFFSET not in [finding.fault for finding in findings]


def test_check_names_and_draws_the_late_channels(log, tmp_path, capsys):
    page = tmp_path / "time.html"
    code, out, err = run(capsys, "check", log, "-v", "cheng_cebon_2011", "--plot", page)
    assert (code, err) == (0, "")
    words = " ".join(out.split())
    assert "0.35 s late" in words
    assert "set delay = 0.35" in words
    text = page.read_text()
    for name in LATE:
        assert name in text
    assert "+0.35 ± 0.0" in text
