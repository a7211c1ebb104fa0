"""Identification with tyres that saturate: friction, choice of the law, logs that were not identified on."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fifthwheel.apps.workflow.runs import run_states
from fifthwheel.base.errors import VehicleError
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.data.record import Record
from fifthwheel.data.record.derived import largest_lateral_acceleration
from fifthwheel.estimate.identify import Identification, OneStage, identify
from fifthwheel.estimate.identify.given import applied
from fifthwheel.estimate.identify.one_stage.estimator import solve_one_stage
from fifthwheel.estimate.identify.sensor_errors import log_sensors
from fifthwheel.estimate.identify.setup import with_tyre_law
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.estimate.observe import Observer, ObserverSettings
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.model.manoeuvres import braked
from fifthwheel.model.manoeuvres.open_loops import single_sine
from fifthwheel.model.plant import Plant, Sensor, article_sensors
from fifthwheel.truck import Vehicle, get
from fifthwheel.truck.quantities import FRICTION, quantity_of

TRUCK = get("cheng_cebon_2011")
GYROS = [f"{quantity}.{unit}" for quantity in ("yaw_rate", "roll_rate") for unit in ("tractor", "semitrailer")]
SIDESLIP = ["sideslip.tractor", "sideslip.semitrailer"]
STEER = "steer.tractor.front"
EXACT = OneStage(tyres="saturating", given={"others": "exact", "sensors": "exact"}, check=False)
"""Everything but the estimated parameters and the noise is known."""


def response(
    acceleration: float,
    friction: float,
    *,
    name: str = "sine",
    offset: float = 0.0,
    seed: int = 1,
    surroundings: Mapping[str, float] | None = None,
) -> Record:
    """A single sine of the own model with tyres that saturate, with the noise of good gyros; offset of the steering."""
    course = single_sine(TRUCK, acceleration=acceleration)
    vehicle, outputs = TRUCK.with_logged_steering([STEER], name), (*GYROS, *SIDESLIP)
    model = dynamics.model(vehicle, outputs, roll=True, tyres="saturating")
    inputs = {"speed": np.full_like(course.time, 24.0), STEER: course.steer}
    values = dynamics.all_parameters(vehicle, outputs, tyres="saturating") | {
        FRICTION: friction,
        **(surroundings or {}),
    }
    _, y = free_response(model, values, course.time, inputs)
    noise = np.random.default_rng(seed).normal(0, 1e-3, (len(y), len(GYROS)))
    signals = {**inputs, STEER: course.steer + offset, **dict(zip(GYROS, (y[:, :4] + noise).T, strict=True))}
    return Record(time=course.time, signals=signals, reference=dict(zip(SIDESLIP, y[:, 4:].T, strict=True)), name=name)


@pytest.fixture(scope="module")
def guess() -> Vehicle:
    values = TRUCK.parameters()
    return TRUCK.replace({name: 0.85 * value for name, value in values.items() if name.endswith("cornering_stiffness")})


@pytest.fixture(scope="module")
def snow(guess: Vehicle) -> Identification:
    """Of a sine that uses two thirds of the friction of snow, with all that a user does not know."""
    records = [response(1.5, 0.3, offset=0.005), response(1.5, 0.3, offset=-0.01, name="other", seed=2)]
    return identify(records[:1], guess, OneStage(tyres="saturating", check=False), validate=records[1:])


@pytest.mark.slow
def test_an_observer_has_all_that_was_estimated(guess: Vehicle) -> None:
    """Tyres of the drive axles with less grip: the states follow from the estimate, also in another log."""
    around = {"tractor.drive.relative_friction": 0.8, "tractor.front.relative_friction": 1.15}
    record, other = (response(a, 0.5, name=f"{a}", surroundings=around) for a in (3.0, 2.5))
    result = identify([record], guess, OneStage(tyres="saturating", check=False))
    assert result.surroundings["tractor.drive.relative_friction"] < 0.95
    for log in (record, other):
        settings, uncertainty, _ = log_sensors(result, log, result.vehicle)
        assert settings["surroundings"]["tractor.drive.relative_friction"] < 0.95
        states = Observer(result.vehicle, log.signals, ObserverSettings(**settings)).batch(log, uncertainty)
        for name in GYROS:
            assert np.std(states.innovation[name]) < 1.7e-3
        for name in SIDESLIP:
            assert np.sqrt(np.mean((states.values[name] - log.reference[name]) ** 2)) < np.radians(0.03)


@pytest.mark.slow
def test_a_grip_that_was_measured_is_a_bound(guess: Vehicle) -> None:
    """The friction is at least 0.8 times that which the lateral acceleration needs."""
    record = response(3.0, 0.75)
    used = largest_lateral_acceleration(record, "tractor") / STANDARD_GRAVITY
    objective = solve_one_stage(
        [record], *applied(guess, replace(EXACT, given={**EXACT.given, FRICTION: 0.1}))
    ).minimum.objective
    assert objective.unknowns_by_name[FRICTION].lower == pytest.approx(0.8 * used)


@pytest.mark.slow
def test_parameters_and_friction(guess: Vehicle) -> None:
    """The own model, everything else known: errors are those of the noise."""
    result = identify([response(2.5, 0.6)], guess, replace(EXACT, tyres="auto"))
    truth = TRUCK.parameters() | {FRICTION: 0.6}
    assert [e.name for e in result.parameters][-1] == FRICTION
    for e in result.parameters:
        assert e.verdict == Verdict.CONVERGED
        assert e.sigma < 0.05 * truth[e.name]
        assert abs(e.value - truth[e.name]) < 3.5 * e.sigma
    assert result.friction == result[FRICTION].value
    assert result.doubts == ()


@pytest.mark.slow
def test_tyres_that_do_not_saturate(guess: Vehicle) -> None:
    """In a gentle run the law is nearly the linear one, and the friction is not informed."""
    result = identify([response(0.3, 0.7)], guess, replace(EXACT, tyres="auto"))
    assert result.settings.tyres == "saturating"
    assert not [note for note in result.notes if note.startswith("tyres: ")]
    *parameters, friction = result.parameters
    for e in parameters:
        assert abs(e.value - TRUCK.parameters()[e.name]) < 3.5 * e.sigma, e.name
        assert e.verdict is Verdict.CONVERGED
    assert (friction.name, friction.verdict) == (FRICTION, Verdict.NOT_EXCITED)
    assert result.friction == friction.value
    assert abs(np.log(result.friction / quantity_of(FRICTION).mean)) < quantity_of(FRICTION).sigma


@pytest.mark.slow
def test_a_result_on_snow(snow: Identification, tmp_path: Path) -> None:
    """It is stored. The model explains logs with a steering offset, which alone would let the truck skid; a predicted
    log has one of its own. A known friction replaces the estimate."""
    snow.save(tmp_path)
    loaded = Identification.load(tmp_path)
    assert loaded.friction == snow.friction == pytest.approx(0.3, rel=0.2)
    assert loaded.settings == snow.settings
    fits = {(fit.log, fit.signal): fit.explained for fit in snow.fits}
    for name in ("sine", "other"):
        assert fits[name, "yaw_rate.semitrailer"] > 0.995
    sensors = log_sensors(snow, response(1.5, 0.5), snow.vehicle, 0.5)
    assert sensors.settings["friction"] == 0.5
    assert FRICTION not in sensors.uncertainty.names
    assert Observer(snow.vehicle, snow.signals, ObserverSettings(**sensors.settings)).settings.tyre_law == "saturating"


@pytest.mark.slow
def test_states_of_both_kinds_of_logs(snow: Identification) -> None:
    """A log of the identification, and one whose sensor errors are estimated with the identified tyres."""
    other = response(1.5, 0.3, offset=-0.01, name="other", seed=2)
    for record in (response(1.5, 0.3, offset=0.005), other):
        run = run_states([record], snow.vehicle, identification=snow, check=False)
        (states,) = run.states
        (note,) = [note for note in run.conclusion.notes if "friction" in note]
        value = float(note.removeprefix("Tyres saturate at a friction of the road of ").split(" ± ")[0])
        assert value == pytest.approx(0.3, rel=0.2)
        assert " ± 0.0" in note
        for name in SIDESLIP:
            error = states.values[name] - record.reference[name]
            assert np.degrees(np.sqrt(np.mean(error**2))) < 0.1
            assert np.mean(np.abs(error) < 1.645 * states.sigma[name]) > 0.8


@pytest.mark.slow
def test_another_log_has_a_friction_of_its_own(snow: Identification) -> None:
    """Identified on snow, driven on a wet road; a gentle log keeps the identified friction, which is then uncertain."""
    wet, gentle = (log_sensors(snow, response(a, 0.6, name="other"), snow.vehicle) for a in (2.5, 0.2))
    assert wet.settings["friction"] == pytest.approx(0.6, rel=0.15)
    assert gentle.settings["friction"] == pytest.approx(snow.friction, rel=0.2)
    for sensors, least, largest in ((wet, 0.0, 0.3), (gentle, 0.59, 0.75)):
        place = sensors.uncertainty.names.index(FRICTION)
        sigma = np.sqrt(sensors.uncertainty.covariance[place, place]) / sensors.settings["friction"]
        assert least < sigma < largest


def test_axle_loads_are_needed() -> None:
    """With an unknown load automatic tyres are linear, and a note says why; saturating ones are an error."""
    steered = TRUCK.with_logged_steering([STEER], "sine")
    unit = steered.units[1]
    groups = (unit.axle_groups[0].model_copy(update={"axles": unit.axle_groups[0].axles[:2]}),)
    third = unit.axle_groups[0].model_copy(
        update={"name": "third", "axles": unit.axle_groups[0].axles[2:], "cornering_stiffness": 4e5}
    )
    vehicle = steered.model_copy(
        update={"units": (steered.units[0], unit.model_copy(update={"axle_groups": (*groups, third)}))}
    )
    with pytest.raises(VehicleError, match="load"):
        identify([response(2.5, 0.6)], vehicle, EXACT)
    settings, note = with_tyre_law(vehicle, replace(EXACT, tyres="auto"))
    assert settings.tyres == "linear"
    assert note.startswith("tyres: linear, because the axle loads are unknown")


@pytest.mark.slow
def test_nonlinear_truck() -> None:
    """Braking on a dry road, with the article's sensors; the peak of the tyres is 0.74.

    The shape of these tyres is 1.14, by default 1.1.
    """
    course = single_sine(TRUCK, acceleration=2.0, lead=2.0)
    run = Plant(TRUCK).drive(braked(course, 2.0))
    record = run.record(article_sensors(TRUCK) | {"speed": Sensor(variance=0.01)}, seed=1)
    result = identify([record], TRUCK, OneStage(tyres="auto", check=False))
    assert all(e.verdict == Verdict.CONVERGED for e in result.parameters)
    assert result[FRICTION].value == pytest.approx(0.74, rel=0.25)
    assert abs(result[FRICTION].value - 0.74) < 1.645 * result[FRICTION].sigma
    for name, value in TRUCK.parameters().items():
        if name.endswith("cornering_stiffness"):
            assert abs(result[name].value - value) < 1.645 * result[name].sigma
    states = result.observer(log=record.name).batch(record, result.uncertainty(record.name))
    for name in SIDESLIP:
        error = np.degrees(states.values[name] - run.truth[name])
        assert np.sqrt(np.mean(error**2)) < 0.15
