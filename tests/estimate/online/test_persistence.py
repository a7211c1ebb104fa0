"""Saved estimates, and estimates of trailers that are coupled and uncoupled."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.data.channels import YAW_RATE
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify.settings import OneStage
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.estimate.online import Learner, LearnerSettings
from fifthwheel.truck import Vehicle, get
from tests.estimate.online.conftest import CONSIDERING, HEIGHT, assert_identified, estimates, learn

pytestmark = pytest.mark.slow


def test_a_loaded_learner_has_the_saved_estimates_and_settings(guess: Vehicle, lanes: Record, tmp_path: Path) -> None:
    settings = LearnerSettings(start_excitation=0.3, max_steer_dropout=0.2)
    saved = learn(guess, lanes, CONSIDERING, learner=settings)
    saved.save(tmp_path / "learner.json")
    loaded = Learner.load(tmp_path / "learner.json")
    for value, original in zip(loaded.parameters, saved.parameters, strict=True):
        assert (value.name, value.verdict) == (original.name, original.verdict)
        assert (value.value, value.sigma) == pytest.approx((original.value, original.sigma), rel=1e-9)
    assert loaded.doubts == saved.doubts
    for one, other in zip(estimates(loaded), estimates(saved), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)
    assert loaded.vehicle().parameters() == pytest.approx(saved.vehicle().parameters(), rel=1e-9)
    assert loaded._live.learner == settings
    loaded.learn(lanes)  # a new run: its time may start again
    assert loaded[HEIGHT].sigma < saved[HEIGHT].sigma
    assert not list(tmp_path.glob(".*"))


def of_version(number: int) -> Callable[[str], str]:
    def change(text: str) -> str:
        document = json.loads(text)
        assert document["format"] == "fifthwheel learner 3"
        return json.dumps({**document, "format": f"fifthwheel learner {number}"})

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text[: len(text) // 2], "not a JSON file, or damaged"),
        (lambda text: "", "not a JSON file, or damaged"),
        (lambda text: "[1, 2]", "not a file of a learner"),
        (lambda text: text.replace('"z": [', '"z": [1.0, ', 1), "damaged, its content does not match its checksum"),
        (lambda text: text.replace("tractor", "trucktor"), "damaged, its content does not match its checksum"),
        (of_version(2), "has format 2 of another version of fifthwheel, expected format 3; start with a new Learner"),
        (of_version(4), "has format 4 of another version of fifthwheel, expected format 3"),
    ],
)
def test_a_file_that_is_damaged_or_not_of_this_version_is_refused(
    learned: Learner, tmp_path: Path, change: Callable[[str], str], message: str
) -> None:
    path = tmp_path / "learner.json"
    learned.save(path)
    path.write_text(change(path.read_text()))
    with pytest.raises(SignalError, match=rf"learner\.json: {message}"):
        Learner.load(path)


def test_another_trailer_keeps_the_estimates_of_the_tractor(
    truck: Vehicle, guess: Vehicle, lanes: Record, tmp_path: Path
) -> None:
    learner = learn(guess, lanes)
    first, first_sigma = {e.name: e for e in learner.parameters}, filter_sigmas(learner)
    learner.couple("empty", guess)
    for estimate in learner.parameters:
        if estimate.name.startswith("tractor."):
            expected = first[estimate.name]
            assert (estimate.value, estimate.sigma) == pytest.approx((expected.value, expected.sigma))
        else:
            assert estimate.verdict == Verdict.NOT_EXCITED
    assert np.linalg.eigvalsh(estimates(learner)[1]).min() > 0
    learner.learn(replace(lanes, time=lanes.time + 100))
    assert_identified(learner, truck)
    second, second_sigma = {e.name: e for e in learner.parameters}, filter_sigmas(learner)

    learner.save(tmp_path / "learner.json")
    learner = Learner.load(tmp_path / "learner.json")
    learner.couple(guess.name, guess)
    for estimate in learner.parameters:
        name = estimate.name
        expected, sigma = (second, second_sigma) if name.startswith("tractor.") else (first, first_sigma)
        assert estimate.value == pytest.approx(expected[name].value)
        assert filter_sigmas(learner)[name] == pytest.approx(sigma[name])


def filter_sigmas(learner: Learner) -> dict[str, float]:
    """Standard deviation of each z without the variance inflation, which follows from the last innovations."""
    names = [u.name for u in learner._live.setup.unknowns]
    return dict(zip(names, np.sqrt(np.diag(estimates(learner)[1])), strict=True))


def test_a_coupling_keeps_sensor_errors_of_the_tractor_and_refuses_other_vehicles(
    guess: Vehicle, lanes: Record
) -> None:
    learner = learn(guess, lanes, OneStage(given={"others": "exact"}, tyres="linear"))
    before, height = {e.name: e for e in learner.sensors}, learner[HEIGHT].value
    learner.couple("empty", guess)
    after = {e.name: e for e in learner.sensors}
    for name in ("steer.tractor.front.offset", "yaw_rate.tractor.offset", "roll_rate.tractor.gain"):
        assert (after[name].value, after[name].sigma) == pytest.approx((before[name].value, before[name].sigma))
    offset = after["yaw_rate.semitrailer.offset"]
    assert (offset.value, offset.sigma) == pytest.approx((0.0, YAW_RATE.error("offset").prior))
    heavier = guess.replace({"semitrailer.yaw_inertia": 2 * guess.parameters()["semitrailer.yaw_inertia"]})
    with pytest.raises(SignalError, match="estimates of cheng_cebon_2011 belong to another vehicle file"):
        learner.couple(guess.name, heavier)
    with pytest.raises(VehicleError, match="a new tractor needs a new Learner"):
        learner.couple("any", get("auburn_6x4"))
    learner.couple(guess.name, guess)
    assert learner[HEIGHT].value == pytest.approx(height)


def test_fixing_a_parameter_ends_a_log(guess: Vehicle, learned: Learner) -> None:
    name = "semitrailer.yaw_inertia"
    (log,) = learned.with_fixed(guess, {name: learned[name].value}).knowledge.logs
    assert name in log.estimated
