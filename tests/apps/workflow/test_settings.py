"""Settings from the options of a user."""

import pytest

from fifthwheel.apps.workflow.start import chosen_one_stage, identification_settings, starts_of, stated_in
from fifthwheel.base.errors import FifthwheelError, VehicleError
from fifthwheel.base.options import IdentifyOptions
from fifthwheel.base.spelling import spelled_for
from fifthwheel.estimate.identify import OneStage
from fifthwheel.estimate.identify.unknowns.parameters import estimated_parameters
from fifthwheel.truck import get

TRUCK = get("cheng_cebon_2011")


def chosen(**choices):
    """Vehicle and settings of the options."""
    return chosen_one_stage(TRUCK, IdentifyOptions(**choices))


def test_without_choices_they_are_the_defaults():
    assert chosen() == (TRUCK, OneStage())


def test_a_fraction_is_a_stated_sigma():
    vehicle, settings = chosen(statements=("semitrailer.roll_stiffness=+- 20 %",))
    assert vehicle.stated == {"semitrailer.roll_stiffness": pytest.approx(0.2 * 2.7e6)}
    assert settings == OneStage(given={"semitrailer.roll_stiffness": "+- 20 %"})
    vehicle, settings = chosen(statements=("semitrailer.roll_stiffness=exact",))
    assert vehicle.stated == {"semitrailer.roll_stiffness": 0.0}
    assert settings.given == {"semitrailer.roll_stiffness": "exact"}


def test_a_file_of_statements(tmp_path):
    """A later option on the same number disagrees; the path of a number may be a table."""
    file = tmp_path / "known.toml"
    file.write_text(
        '[given]\n"steer.*.delay" = "+- 5 ms"\nsemitrailer.roll_stiffness = "+- 20 %"\nroad.friction = 0.6\n'
    )
    assert stated_in((f"@{file}", "road.bank=+- 1 deg")) == {
        "steer.*.delay": "+- 5 ms",
        "semitrailer.roll_stiffness": "+- 20 %",
        "road.friction": 0.6,
        "road.bank": "+- 1 deg",
    }
    with pytest.raises(FifthwheelError, match=r"semitrailer\.roll_stiffness: expected one statement, got"):
        stated_in((f"@{file}", "semitrailer.roll_stiffness=+- 10 %"))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", r"known\.toml: expected a table \[given\]"),
        ("given = 3", r"known\.toml: expected a table \[given\]"),
        ("[given]\nmass = [1]", r"known\.toml: mass: expected a text such as '\+- 5 %', or a number in SI, got \[1\]"),
        ("[given]\nmass = true", r"known\.toml: mass: expected a text"),
        ("[given]\nmass = nan", r"mass: expected a finite number"),
        ("[given", r"known\.toml: "),
    ],
)
def test_a_file_without_statements_is_refused(tmp_path, content, message):
    file = tmp_path / "known.toml"
    file.write_text(content)
    with pytest.raises(FifthwheelError, match=message):
        stated_in((f"@{file}",))
    with pytest.raises(FifthwheelError, match=r"missing\.toml: cannot be read"):
        stated_in((f"@{tmp_path / 'missing.toml'}",))


def test_free_parameters_are_estimated_in_addition_to_the_usual_ones():
    statements = ("tractor.yaw_inertia=free", "semitrailer.payload.height=exact")
    vehicle, settings = chosen(statements=statements, tyres="linear", check=False)
    assert estimated_parameters(vehicle, settings) == [
        "tractor.front.cornering_stiffness",
        "tractor.drive.cornering_stiffness",
        "semitrailer.cornering_stiffness",
        "semitrailer.yaw_inertia",
        "tractor.yaw_inertia",
    ]
    assert not settings.check


def test_any_load_estimates_the_laden_body():
    vehicle, settings = chosen(statements=("tractor.yaw_inertia=free",), any_load=True)
    assert not settings.uniform_payload
    estimated = estimated_parameters(vehicle, settings)
    assert {"semitrailer.sprung.cog_height", "semitrailer.sprung.roll_inertia", "tractor.yaw_inertia"} < {*estimated}
    assert "semitrailer.payload.height" not in estimated


def test_statements_replace_those_of_the_base():
    base = OneStage(given={"sensors": "exact", "road.bank": "+- 1 deg"})
    _, settings = chosen_one_stage(TRUCK, IdentifyOptions(statements=("road.bank=exact",)), base=base)
    assert settings.given == {"sensors": "exact", "road.bank": "exact"}


def test_the_article_keeps_its_own_statements():
    options = IdentifyOptions(method="article", statements=("tractor.front.cornering_stiffness=exact",))
    _, settings = identification_settings(TRUCK, options)
    assert settings.given == {"sensors": "exact", "tractor.front.cornering_stiffness": "exact"}


def test_wrong_choices_are_refused():
    with pytest.raises(FifthwheelError, match="steer_lag"):
        chosen(statements=("steer_lag=+- 0.1 s",))
    with pytest.raises(VehicleError, match=r"tractor\.colour"):
        chosen(statements=("tractor.colour=exact",))


@pytest.mark.parametrize(
    "wrong",
    [
        {"statements": ("softening=exact",), "tyres": "saturating"},
        {"statements": ("road.friction=wet",), "tyres": "linear"},
        {"passes": 3},
        {"tyres": "linear", "method": "two-stage"},
        {"load": ("a", "b")},
    ],
)
def test_a_refused_setting_is_named_in_the_words_of_the_front_end(wrong):
    for words, mark in (("command line", "--"), ("workbench", "“")):
        with spelled_for(words), pytest.raises(FifthwheelError, match=mark):
            starts_of(TRUCK, IdentifyOptions(**wrong))
