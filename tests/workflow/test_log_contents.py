"""The survey of a file and the map that is proposed for it."""

from pathlib import Path

from fifthwheel.workflow import survey_file


def test_a_log_without_signals_has_a_survey(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t,a,b\n" + "".join(f"{k / 10},{k},{-k}\n" for k in range(20)))
    contents = survey_file(path)
    assert list(contents.survey.contents) == ["t", "a", "b"]
    assert not contents.proposal.signals.signals
    assert "speed: not found" in contents.signals_toml
