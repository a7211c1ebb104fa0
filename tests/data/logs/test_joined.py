"""Logs of one logger are compared together."""

import numpy as np
import pytest

from fifthwheel.apps.workflow.inputs import survey_files
from fifthwheel.base.errors import SignalError
from fifthwheel.data.logs.joined import open_logs
from fifthwheel.data.logs.row_time import RowTime
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get

TRUCK = get("cheng_cebon_2011")
ROLL = "roll_rate.semitrailer"


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """One with an inverted roll rate that is too weak, one where it is clear, and one with another column."""
    paths = []
    for name, sigma in (("weak", 0.15), ("clear", 0.0), ("other", 0.0)):
        record = simulate(TRUCK, count=2, rate=50.0, seed=1)
        noise = sigma * np.random.default_rng(2).normal(size=len(record))
        columns = {"t": record.time + 1000.0, **record.signals, ROLL: noise - record.signals[ROLL], "gas": record.time}
        if name == "other":
            columns["air"] = columns.pop("gas")
        path = tmp_path_factory.mktemp("logs") / f"{name}.csv"
        np.savetxt(path, np.column_stack([*columns.values()]), "%.6f", ",", header=",".join(columns), comments="")
        paths.append(path)
    return paths


def test_a_sign_follows_from_the_logs_together_or_is_asked(logs):
    weak, clear, _ = logs
    alone = survey_files([weak], TRUCK).proposal
    assert alone.signals.signals[ROLL].sign == 1
    assert any(question.signal == ROLL and "not clear" in question.message for question in alone.questions)
    together = survey_files([weak, clear], TRUCK)
    assert together.proposal.signals.signals[ROLL].sign == -1
    assert ROLL not in [question.signal for question in together.proposal.questions]
    assert together.survey.name == "weak.csv and clear.csv"
    assert together.survey.stop - together.survey.start == pytest.approx(2 * 15.98)


def test_each_log_begins_after_the_one_before(logs):
    with open_logs(logs[:2]) as log:
        rows = RowTime(log, log.time)
        time = np.concatenate([rows.of(chunk) for chunk in log.chunks([ROLL])])
    steps = np.diff(time)
    assert np.sort(steps)[-2:] == pytest.approx([0.02, 60.0])


def test_logs_of_other_loggers_are_refused(logs):
    with pytest.raises(SignalError, match=r"other.csv and weak.csv: '(air|gas)' is not a column of both.*propose one"):
        open_logs(logs)
