"""Identification with tyres that saturate: friction, choice of the law, logs that were not identified on."""

from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fifthwheel.apps.workflow.runs import run_states
from fifthwheel.apps.workflow.start import identification_settings
from fifthwheel.base.errors import VehicleError
from fifthwheel.base.options import IdentifyOptions
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.data.record import Record
from fifthwheel.data.record.derived import largest_lateral_acceleration
from fifthwheel.estimate.identify import Identification, OneStage, identify
from fifthwheel.estimate.identify.fits import _of_log
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
from fifthwheel.model.plant import Plant, Properties, Sensor, article_sensors
from fifthwheel.truck import Vehicle, get
from fifthwheel.truck.quantities import COMBINED_SLIP, FRICTION, quantity_of

pytestmark = pytest.mark.slow

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


def test_a_grip_that_was_measured_is_a_bound(guess: Vehicle) -> None:
    """The friction is at least 0.8 times that which the lateral acceleration needs."""
    record = response(3.0, 0.75)
    used = largest_lateral_acceleration(record, "tractor") / STANDARD_GRAVITY
    objective = solve_one_stage(
        [record], *applied(guess, replace(EXACT, given={**EXACT.given, FRICTION: 0.1}))
    ).minimum.objective
    assert objective.unknowns_by_name[FRICTION].lower == pytest.approx(0.8 * used)


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


@pytest.mark.parametrize(("acceleration", "friction"), [(0.3, 0.7), (2.0, 5.0)])
def test_tyres_that_do_not_saturate(guess: Vehicle, acceleration: float, friction: float) -> None:
    """In a gentle run, or where tyres are almost linear, the law is nearly the linear one, and the friction is not
    informed."""
    settings = replace(EXACT, tyres="auto")
    result = identify([response(acceleration, friction)], guess, settings)
    assert result.settings.tyres == "saturating"
    assert not [note for note in result.notes if note.startswith("tyres: ")]
    truth = TRUCK.parameters()
    for e in result.parameters:
        if e.name != FRICTION:
            assert abs(e.value - truth[e.name]) < 3.5 * e.sigma, e.name
    friction_of_log, prior = result[FRICTION], quantity_of(FRICTION)
    assert friction_of_log.verdict is not Verdict.CONVERGED
    if acceleration < 1:
        assert friction_of_log.verdict is Verdict.NOT_EXCITED
        assert result.friction == friction_of_log.value
        assert abs(np.log(result.friction / prior.mean)) < prior.sigma
        assert all(e.verdict is Verdict.CONVERGED for e in result.parameters if e.name != FRICTION)


def test_linear_tyres_beyond_their_range_are_doubtful(guess: Vehicle) -> None:
    result = identify([response(3.0, 0.7)], guess, OneStage(tyres="linear", check=False))
    assert {e.verdict for e in result.parameters} == {Verdict.DOUBTFUL}


def test_softening_on_a_slippery_road_is_a_doubt(guess: Vehicle) -> None:
    """Below 3 m/s^2, and without one on a dry road; states with a friction need an identification with one."""
    settings, records = OneStage(tyres="linear", check=False), [response(1.5, f) for f in (0.3, 0.75)]
    slippery, dry = (identify([record], guess, settings) for record in records)
    assert dry.doubts == ()
    (doubt,) = slippery.doubts
    assert doubt.causes[0].name.endswith(".softening")
    known = ObserverSettings(friction=0.3)
    run = run_states(records[:1], slippery.vehicle, known, identification=slippery, check=False)
    assert run.notes == ('The identification had linear tyres: identify again with tyres="saturating" or auto.',)


def test_stored(snow: Identification, tmp_path) -> None:
    snow.save(tmp_path)
    loaded = Identification.load(tmp_path)
    assert loaded.friction == snow.friction == pytest.approx(0.3, rel=0.2)
    assert loaded.settings == snow.settings


def test_the_model_explains_a_log_with_a_steering_offset(snow: Identification) -> None:
    """The offset alone would let the truck skid; a predicted log has one of its own."""
    fits = {(fit.log, fit.signal): fit.explained for fit in snow.fits}
    for name in ("sine", "other"):
        assert fits[name, "yaw_rate.semitrailer"] > 0.995


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


def test_another_log_has_a_friction_of_its_own(snow: Identification) -> None:
    """Identified on snow, driven on a wet road; a gentle log keeps the identified friction, which is then uncertain."""
    wet, gentle = (log_sensors(snow, response(a, 0.6, name="other"), snow.vehicle) for a in (2.5, 0.2))
    assert wet.settings["friction"] == pytest.approx(0.6, rel=0.15)
    assert gentle.settings["friction"] == pytest.approx(snow.friction, rel=0.2)
    for sensors, least, largest in ((wet, 0.0, 0.3), (gentle, 0.59, 0.75)):
        place = sensors.uncertainty.names.index(FRICTION)
        sigma = np.sqrt(sensors.uncertainty.covariance[place, place]) / sensors.settings["friction"]
        assert least < sigma < largest


def test_a_known_friction_replaces_the_estimate(snow: Identification) -> None:
    sensors = log_sensors(snow, response(1.5, 0.5), snow.vehicle, 0.5)
    assert sensors.settings["friction"] == 0.5
    assert FRICTION not in sensors.uncertainty.names
    assert Observer(snow.vehicle, snow.signals, ObserverSettings(**sensors.settings)).settings.tyre_law == "saturating"


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


def test_options() -> None:
    _, settings = identification_settings(TRUCK, IdentifyOptions(tyres="saturating", statements=("road.friction=0.3",)))
    assert (settings.tyres, settings.given) == ("saturating", {FRICTION: "0.3"})
    with pytest.raises(Exception, match=r"road\.friction=0\.3: linear tyres have no friction"):
        identification_settings(TRUCK, IdentifyOptions(tyres="linear", statements=("road.friction=0.3",)))
    with pytest.raises(Exception, match='tyres: needs method="one_stage"'):
        identification_settings(TRUCK, IdentifyOptions(method="article", tyres="linear"))
    _, settings = identification_settings(TRUCK, IdentifyOptions(tyres="auto", statements=("road.friction=exact",)))
    assert settings.given == {FRICTION: "exact"}


@pytest.mark.parametrize(("acceleration", "factor", "braking"), [(1.5, 0.35, 0.0), (2.0, 1.0, 2.0)])
def test_nonlinear_truck(acceleration: float, factor: float, braking: float) -> None:
    """0.36 g on snow, and braking on a dry road, with the article's sensors; the peak of the tyres is 0.74.

    The shape of these tyres is 1.14, by default 1.1.
    """
    course = single_sine(TRUCK, acceleration=acceleration, lead=2.0)
    run = Plant(TRUCK, Properties(friction=factor)).drive(braked(course, braking) if braking else course)
    record = run.record(article_sensors(TRUCK) | {"speed": Sensor(variance=0.01 if braking else 0.0)}, seed=1)
    result = identify([record], TRUCK, OneStage(tyres="auto", check=False))
    assert all(e.verdict == Verdict.CONVERGED for e in result.parameters)
    assert result[FRICTION].value == pytest.approx(0.74 * factor, rel=0.25 if braking else 0.21)
    assert abs(result[FRICTION].value - 0.74 * factor) < 1.645 * result[FRICTION].sigma
    for name, value in TRUCK.parameters().items():
        if name.endswith("cornering_stiffness"):
            assert abs(result[name].value - value) < 1.645 * result[name].sigma
    states = result.observer(log=record.name).batch(record, result.uncertainty(record.name))
    for name in SIDESLIP:
        error = np.degrees(states.values[name] - run.truth[name])
        assert np.sqrt(np.mean(error**2)) < 0.15


def test_logs_with_and_without_braking() -> None:
    """On a dry road, up to 3 m/s² sideways and along: the estimates are right, although wheels lock, which the model
    does not have, so that they may be doubted; the logs inform how much a braking force reduces the side force."""
    records = []
    for seed, (acceleration, braking) in enumerate([(2.0, 0.0), (2.0, 2.0), (3.0, 0.0), (3.0, 3.0)]):
        course = single_sine(TRUCK, acceleration=acceleration, duration=8.0)
        run = Plant(TRUCK).drive(braked(course, braking) if braking else course)
        records.append(replace(run.record(article_sensors(TRUCK), seed=seed), name=f"{acceleration:g} {braking:g}"))
    result, true = identify(records, TRUCK, OneStage()), TRUCK.parameters() | {FRICTION: 0.74}
    assert all(e.verdict in (Verdict.CONVERGED, Verdict.DOUBTFUL) for e in result.parameters)
    assert all(abs(e.value - true[e.name]) < 1.645 * e.sigma for e in result.parameters)
    (slip,) = [e for e in result.uncertain if e.name == COMBINED_SLIP]
    assert slip.sigma < 0.7 * slip.prior  # less than half of the variance


def test_unknowns_of_one_log_have_the_names_of_an_only_log() -> None:
    """Also those of its segments; those that logs share are not its own."""
    names = ("mass", "offset@0", "offset@1", "bank.road@0.0", "bank.road@1.0", "bank.road@1.1", "offset@10", "play@1")
    problem = SimpleNamespace(names=names, logs=[SimpleNamespace(name="first"), SimpleNamespace(name="second")])
    solution = SimpleNamespace(problem=problem, minimum=SimpleNamespace(z=np.arange(8.0)))
    expected = {"offset@0": 2.0, "bank.road@0.0": 4.0, "bank.road@0.1": 5.0, "play@0": 7.0}
    assert _of_log(solution, problem.logs[1]) == expected
    assert _of_log(solution, problem.logs[0]) == {"offset@0": 1.0, "bank.road@0.0": 3.0}
