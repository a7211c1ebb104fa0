"""Entries of a signals.toml changed, without a loss of comments and other entries."""

from pathlib import Path

import pytest

from fifthwheel.apps.workflow.inputs import survey_files
from fifthwheel.base.errors import SignalError
from fifthwheel.data.logs import SignalMap
from fifthwheel.data.logs.map_text import is_unchanged, with_channel, without_channel

EXAMPLES = Path(__file__).parents[3] / "examples"

TEXT = """# by hand
databases = ["truck.dbc"]

[signals]
speed = "v" # short

[signals."yaw_rate.tractor"]
# upside down
column = "gyro"
sign = -1

[signals.roll_rate.tractor]
column = "roll"

[reference]
"lateral_velocity.tractor" = "vy"
"""


def test_only_the_signal_changes():
    for signal, keys in {
        "speed": {"unit": "km/h"},
        "yaw_rate.tractor": {"sign": 1, "delay": 0.35},
        "roll_rate.tractor": {"gain": 2.0},
        "lateral_velocity.tractor": {"sign": -1},
        "yaw_rate.semitrailer": {"column": "gyro 2"},
    }.items():
        before, text = SignalMap.parse(TEXT), with_channel(TEXT, signal, **keys)
        after = SignalMap.parse(text)
        channel = getattr(after, "reference" if signal in before.reference else "signals")[signal]
        assert {key: getattr(channel, key) for key in keys} == keys
        for name in ("signals", "reference"):
            rest = [{s: c for s, c in getattr(m, name).items() if s != signal} for m in (before, after)]
            assert rest[0] == rest[1]
        assert all(comment in text for comment in ("# by hand", "# short", "# upside down"))


def test_a_change_that_is_not_accepted_is_refused():
    for keys in ({"unit": "kg"}, {"column": "gyro"}, {"sign": 2}, {"gain": float("nan")}):
        with pytest.raises(SignalError):
            with_channel(TEXT, "speed", **keys)


def test_a_signal_is_removed():
    """It does not return by the name of its column."""
    for signal in ("speed", "yaw_rate.tractor", "roll_rate.tractor", "lateral_velocity.tractor"):
        after = SignalMap.parse(without_channel(TEXT, signal))
        assert signal not in {*after.signals, *after.reference}
        assert len(after.signals) + len(after.reference) == 3
        assert after.ignore == ()
    text = without_channel('[signals]\nspeed = "speed [m/s]"\n', "speed")
    assert not SignalMap.parse(text).completed(["speed"]).signals


def test_a_map_may_begin_empty_and_default_values_are_left_out():
    assert SignalMap.parse(with_channel("", "speed", column="v")).signals["speed"].column == "v"
    text = with_channel(with_channel(TEXT, "speed", delay=0.2, unit="km/h"), "speed", delay=0.0, unit=None)
    assert SignalMap.parse(text) == SignalMap.parse(TEXT)
    assert "delay" not in text


def test_the_uncertainty_of_a_number_stays():
    """A button of the workbench that corrects a delay must not drop what the user states of it."""
    for key, old, value, new in [
        ("gain", "0.05 +- 2 %", 0.06, "0.06 +- 2 %"),
        ("gain", "0.05 exact", None, "1 exact"),
        ("delay", "200 ms +- 5 ms", 0.35, "0.35 s +- 5 ms"),
        ("delay", "0.2 +- 0.005", 0.35, "0.35 +- 0.005"),
        ("delay", "+- 5 ms", 0.0, "0 s +- 5 ms"),
        ("offset", "1 deg +- 0.1 deg", 0.02, "0.02 rad +- 0.1 deg"),
        ("gain", "0.05 +- 2 %", "0.06 +- 3 %", "0.06 +- 3 %"),
    ]:
        text = f'[signals."steer.tractor.front"]\ncolumn = "swa"\n{key} = "{old}"\n'
        assert f'{key} = "{new}"' in with_channel(text, "steer.tractor.front", **{key: value})


def test_a_proposal_is_unchanged_until_it_is_edited(tmp_path):
    path = tmp_path / "signals.toml"
    contents = survey_files([EXAMPLES / "lane_changes.csv"], map_file=path)
    assert is_unchanged(path)
    path.write_text(contents.signals_toml.replace("[signals", "# mine\n[signals", 1))
    assert not is_unchanged(path)
    assert not is_unchanged(tmp_path / "absent.toml")
