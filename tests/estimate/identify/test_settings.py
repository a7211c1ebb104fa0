"""Settings that are refused, and the published ones."""

import math
from dataclasses import replace

import pytest

from fifthwheel.apps.cheng_cebon_2011 import TwoStage, article
from fifthwheel.base.errors import FifthwheelError, SignalError
from fifthwheel.estimate.identify import OneStage, identify
from fifthwheel.estimate.identify.given import applied
from fifthwheel.estimate.observe import Observer, ObserverSettings
from fifthwheel.estimate.online import Learner, LearnerSettings
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get


@pytest.mark.parametrize(
    ("kind", "changes", "message"),
    [
        (TwoStage, {"passes": 0}, "passes: expected a number of 1 or more, got 0; correct it"),
        (TwoStage, {"Q_x": {"*": -1.0}}, "Q_x, .*: expected a finite number of 0 or more, got -1"),
        (TwoStage, {"Q_p": {"yaw_inertia": -1.0}}, "yaw_inertia: expected a finite variance of 0 or more, got -1"),
        (TwoStage, {"Q_p": {"yaw_inertia": "400"}}, "yaw_inertia=400: expected '[+]- SIGMA'"),
        (TwoStage, {"P_p": {"yaw_inertia": None}}, r"yaw_inertia, float: .* give a variance in SI, such as 475\*\*2"),
        (TwoStage, {"R": {"yaw_rate.tractor": 0.0}}, "yaw_rate.tractor: expected a finite number above 0, got 0"),
        (TwoStage, {"R": {"yaw_rat.tractor": 1e-4}}, "R, yaw_rat.tractor: .* did you mean 'yaw_rate.tractor'"),
        (
            OneStage,
            {"tolerance": math.nan, "iterations": 0},
            r"(?s)tolerance: .* got nan.*\niterations: .* 1 or more, got",
        ),
        (
            OneStage,
            {"given": {"mass": "+-"}},
            r"mass=\+-: expected a standard deviation .*; give it with a unit or in %",
        ),
        (OneStage, {"given": {"mass": None}}, "mass, float: expected a number, got None; give a number in SI"),
        (OneStage, {"given": {"": "exact"}}, "=exact: expected a name and 'VALUE"),
        (OneStage, {"given": {"sensors": "+- 1 %"}}, "expected 'exact' for so many numbers, got '.*'; name fewer"),
        (OneStage, {"form": "banana"}, "form: expected 'output_error' or 'prediction_error', got 'banana'"),
        (OneStage, {"tyres": "round"}, "tyres: expected 'linear', 'saturating', 'auto' or a tyre law, got 'round'"),
        (OneStage, {"check": "no"}, "check: expected a valid boolean, got 'no'"),
        (ObserverSettings, {"noise": {"speed.tractor": 1e-4}}, "noise, speed.tractor: .* belongs to the whole vehicle"),
        (ObserverSettings, {"sensor_errors": {"steer.tractor.front.ofset": 0.1}}, "not the name of a sensor error"),
        (ObserverSettings, {"positions": {"sidelip.semitrailer": -2.0}}, "did you mean 'sideslip.semitrailer'"),
    ],
)
def test_refused(kind: type, changes: dict[str, object], message: str) -> None:
    with pytest.raises(SignalError, match=message):
        kind(**changes)


BOTH = "tolerance gate min_speed"
LEARNER = (
    "excitation_window high_pass_time max_lateral_acceleration discrepancy_time offset_time parameter_time "
    "max_innovation_ratio max_autocorrelation innovation_window max_steer max_steer_rate max_speed_change coast "
    "max_gap stop_excitation"
)
POSITIVE = {OneStage: f"{BOTH} outlier", TwoStage: BOTH, LearnerSettings: LEARNER}


def test_limits() -> None:
    for method, names in POSITIVE.items():
        for name in names.split():
            assert getattr(method(**{name: 1e-9}), name) == 1e-9
            for wrong in (0, -1e-9, math.nan):
                with pytest.raises(SignalError, match=f"^{name}: expected"):
                    method(**{name: wrong})
    for name in ("settling_time", "max_steer_dropout", "hold"):
        assert getattr(LearnerSettings(**{name: 0.0}), name) == 0.0
        with pytest.raises(SignalError, match=f"^{name}: expected a number of 0 or more"):
            LearnerSettings(**{name: -1e-9})
    for method, settings, allowed in (
        (TwoStage, {"forgetting": 1.0}, True),
        (TwoStage, {"forgetting": 1.0 + 1e-9}, False),
        (TwoStage, {"forgetting": 0.0}, False),
        (OneStage, {"noise": {"yaw_rate.tractor": 1e-12}}, True),
        (OneStage, {"noise": {"yaw_rate.tractor": 0.0}}, False),
        (OneStage, {"noise": {"yaw_rate.tractor": math.inf}}, False),
        (OneStage, {"given": {"a": 1e-9}}, True),
        (LearnerSettings, {"discrepancy": {"a": 0.0}}, True),
        (LearnerSettings, {"discrepancy": {"a": -1e-9}}, False),
        (LearnerSettings, {"discrepancy": {"a": math.inf}}, False),
        (LearnerSettings, {"start_excitation": 0.2, "stop_excitation": 0.2}, True),
        (LearnerSettings, {"start_excitation": 0.2, "stop_excitation": 0.2 + 1e-9}, False),
    ):
        if allowed:
            method(**settings)
            continue
        with pytest.raises(SignalError, match="expected"):
            method(**settings)


def test_the_settings_of_the_article() -> None:
    """Sections 3.1 to 3.3, and 4.2: random walk of 0.1 % and 5 mm, shrunk by 0.999, no process noise, one pass."""
    settings = article()
    of_all = {"cornering_stiffness": "+- 0.1 %", "yaw_inertia": "+- 0.1 %", "payload.height": "+- 5 mm"}
    assert (settings.Q_p, settings.P_p, settings.forgetting) == (of_all, of_all, 0.999)
    assert (settings.passes, settings.rounds, settings.Q_x, settings.average) == (1, 1, {"*": 0.0}, True)
    of_test = article(Q_p={"yaw_inertia": 400**2}, forgetting=0.9995)
    assert of_test == replace(settings, Q_p=of_test.P_p, P_p=of_all | {"yaw_inertia": 400.0**2}, forgetting=0.9995)
    switched_off = ("logarithmic", "consistent", "coupled", "restart", "relaxation", "adapt_noise")
    assert not any(getattr(settings, name) for name in switched_off)
    assert settings.given == {"sensors": "exact"}
    assert settings.gate >= 1e6
    assert article(rounds=3) == replace(settings, rounds=3)


def test_impossible_numbers_are_refused() -> None:
    for given, message in (
        ({"semitrailer.mass": "+- -5 %"}, "expected a finite standard deviation, 0 or more"),
        ({"semitrailer.mass": math.inf}, "semitrailer.mass: expected a finite number, got inf"),
        ({"steer.*.gain": "+- -5 %"}, "expected a finite standard deviation, 0 or more"),
    ):
        with pytest.raises(FifthwheelError, match=message):
            applied(get("cheng_cebon_2011"), OneStage(given=given))


def test_noise_of_a_unit_that_the_vehicle_does_not_have_is_refused() -> None:
    truck, noise = get("cheng_cebon_2011"), {"yaw_rate.tracto": 0.1}
    record, message = (
        simulate(truck, count=1),
        "noise, yaw_rate.tracto: .* has no unit 'tracto'; did you mean 'tractor'",
    )
    for refused in (
        lambda: identify([record], truck, OneStage(noise=noise)),
        lambda: identify([record], truck, TwoStage(R=noise)),
        lambda: Learner(truck, record.signals, OneStage(noise=noise)),
        lambda: Observer(truck, record.signals, ObserverSettings(noise=noise)),
    ):
        with pytest.raises(SignalError, match=message):
            refused()


def test_lists_and_whole_numbers_are_accepted() -> None:
    settings = OneStage(given={"tractor.mass": 7000}, reported=["tractor.mass"])
    assert settings == OneStage(given={"tractor.mass": 7000.0}, reported=("tractor.mass",))
    assert isinstance(TwoStage(gate=1).gate, float)
