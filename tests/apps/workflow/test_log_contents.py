"""The survey of a file and the map that is proposed for it."""

from pathlib import Path

import numpy as np
import pytest

from fifthwheel.apps.workflow.inputs import propose_signals, survey_file
from fifthwheel.data.logs.mapping.survey import survey_log
from fifthwheel.data.logs.readers import sample as sampling
from fifthwheel.data.logs.readers import text
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get


def test_a_log_without_signals_has_a_survey(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t,a,b\n" + "".join(f"{k / 10},{k},{-k}\n" for k in range(20)))
    contents = survey_file(path)
    assert list(contents.survey.contents) == ["t", "a", "b"]
    assert not contents.proposal.signals.signals
    assert "speed: not found" in contents.signals_toml


def test_a_sample_of_a_large_log_gives_the_map_of_the_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The pauses between the parts of the sample are not faults of the log."""
    truck = get("cheng_cebon_2011")
    record = simulate(truck, count=20)
    names = {"v_GPS [m/s]": "speed", "GierSZM [rad/s]": "yaw_rate.tractor", "GierSA [rad/s]": "yaw_rate.semitrailer"}
    columns = [record.time, *(record.signals[name] for name in names.values()), -record.signals["steer.tractor.front"]]
    path = tmp_path / "log.csv"
    np.savetxt(path, np.column_stack(columns), "%.5f", ",", header=",".join(["t", *names, "delta"]), comments="")
    whole = survey_file(path)
    monkeypatch.setattr(sampling, "_LARGE", 1e4)
    monkeypatch.setattr(sampling, "_PART", path.stat().st_size / 40)
    with text.open_log(path) as log:
        log.sample()
        sample = propose_signals(log, survey_log(log))
    assert sample.survey.contents["v_GPS"].samples < 0.25 * len(record)
    assert sample.signals_toml == whole.signals_toml
    assert "sign = -1" in sample.signals_toml
    assert not sample.proposal.findings
