"""An assessment predicts the sigmas and verdicts of fits, and the effect of every remedy that it reports."""

import json
from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.data.record import Record
from fifthwheel.data.record.derived import article_gyro_variance
from fifthwheel.estimate.design import (
    AssessmentSettings,
    InformationAssessment,
    ParameterAssessment,
    Remedy,
    predict_sigmas,
)
from fifthwheel.estimate.design.predict import InformationPredictor, combine_information
from fifthwheel.estimate.design.remedies import LANE_CHANGE, REPEAT, TESTED_AXIS, TESTED_STIFFNESS
from fifthwheel.estimate.identify import OneStage, identify
from fifthwheel.estimate.identify.dataset import LogData
from fifthwheel.estimate.identify.one_stage.problem import Problem
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.model.simulate import simulate
from fifthwheel.results.report.information import information_document
from fifthwheel.truck import Vehicle
from fifthwheel.truck.quantities import MASS_SCALE, quantity_of
from fifthwheel.truck.spoken_names import spoken
from tests.estimate.conftest import without

EXACT = OneStage(given={"others": "exact", "sensors": "exact"}, tyres="linear")
"""The numbers of the simulated truck are exact, and its tyres are linear."""
HEIGHT = "semitrailer.payload.height"
FRONT = "tractor.front.cornering_stiffness"
AXIS = "semitrailer.roll_axis_height"
INERTIA = "semitrailer.yaw_inertia"
KEEN = AssessmentSettings(enough=1e-6, min_reduction=0.01, max_remedies=4)
"""Reports every remedy that reduces a sigma by 1 %."""


@pytest.fixture(scope="module")
def record(truck) -> Record:
    return simulate(truck, count=2, seed=4, name="lanes")


@pytest.fixture(scope="module")
def assessment(truck, record) -> InformationAssessment:
    return predict_sigmas([record], truck)


def first_known(assessment: ParameterAssessment) -> Remedy:
    """The best single number to know."""
    return next(remedy for remedy in assessment.remedies if remedy.kind == "know")


def sigmas(assessment: InformationAssessment) -> np.ndarray:
    return np.array([p.sigma for p in assessment.parameters])


@pytest.mark.slow
def test_a_fit_gives_the_predicted_result(truck, record):
    """Sigma and verdict, also of a height that the user knows better than the log; the fit estimates the noise, and
    linearises at its own estimate."""
    known = truck.with_stated({HEIGHT: 0.02})
    before, after = predict_sigmas([record], known), identify([record], known)
    for predicted in before.parameters:
        estimate = after[predicted.name]
        assert (predicted.verdict, predicted.unit) == (estimate.verdict, estimate.unit)
        assert predicted.prior == pytest.approx(estimate.prior)
        assert predicted.sigma == pytest.approx(estimate.sigma, rel=0.2)
        assert set(predicted.correlated_with[:1]) <= set(estimate.correlated_with)
    height = before[HEIGHT]
    assert (height.verdict, height.prior) == (Verdict.STATED, pytest.approx(0.02))
    assert 0.01 < height.sigma < 0.02


@pytest.mark.slow
def test_information_is_that_of_the_problem(truck, record):
    """The sum over channels and segments without Huber's weights; one that is not logged would be measured with any of
    the others."""
    yaw, roll, other, added = "yaw_rate.tractor", "roll_rate.semitrailer", "yaw_rate.semitrailer", record.signals
    kept = {name: record.signals[name].copy() for name in ("speed", "steer.tractor.front", yaw, roll)}
    kept[yaw][:300], kept[roll][100:500] = np.nan, np.nan
    gaps = added[other].copy()
    gaps[100:300] = np.nan
    predictor = InformationPredictor.of(truck.with_logged_steering(added, "lanes"), OneStage(), [20.0])

    def log(signals: dict[str, np.ndarray]) -> LogData:
        segments = [replace(record, signals=signals).cut(*part) for part in ((0, 7), (8, 15))]
        return LogData(name="lanes", segments=segments, noise=article_gyro_variance(["tractor", "semitrailer"]))

    run = predictor.run_information(log(kept))
    assert run.logged.keys() == {yaw, roll}
    settings = replace(predictor.setup.settings, outlier=np.inf)
    problem = Problem(replace(predictor.setup, settings=settings), [log({**kept, other: gaps})])
    expected = problem.expand(np.zeros(len(problem.names))).hessian - np.eye(len(problem.names))
    order = [problem.names.index(name) for name in run.names]
    scale = 1e-9 * np.abs(expected).max()
    assert run.information([other]) == pytest.approx(expected[np.ix_(order, order)], rel=1e-9, abs=scale)
    assert not run.information()[run.names.index("articulation.semitrailer.offset@0")].any()


def test_every_run_has_its_own_sensor_errors_and_initial_states(truck, record):
    vehicle = truck.with_logged_steering(record.signals, record.name)
    predictor = InformationPredictor.of(vehicle, OneStage(), [20.0])
    log = LogData(name="lanes", segments=[record.cut(0, 7), record.cut(8, 15)])
    run = predictor.run_information(log)
    names, information = combine_information([run, run], known=["steer.tractor.front.gain"])
    shared = [name for name in run.names if "@" not in name and name != "steer.tractor.front.gain"]
    own = [name for name in run.names if "@" in name]
    assert {"steer.tractor.front.offset@0", "yaw_rate.tractor@0.1"} <= set(own)
    assert [name for name in names if "@" not in name] == shared
    assert {name for name in names if "@1" in name} == {name.replace("@0", "@1") for name in own}
    single = run.information()
    pick = np.ix_([run.names.index(n) for n in shared], [run.names.index(n) for n in shared])
    both = np.ix_([names.index(n) for n in shared], [names.index(n) for n in shared])
    assert information[both] == pytest.approx(2 * single[pick])
    first, second = names.index("yaw_rate.tractor@0.1"), names.index("yaw_rate.tractor@1.1")
    assert information[first, first] == information[second, second] > 0
    assert information[first, second] == 0


def test_a_roll_test_helps_as_predicted(truck, record, assessment):
    remedy = assessment[HEIGHT].remedies[0]
    assert remedy.roll_test == "semitrailer"
    p, (group,) = truck.parameters(), truck.unit("semitrailer").axle_groups
    springs = ("semitrailer.roll_stiffness", "semitrailer.tyre_roll_stiffness")
    prior = 0.1 * np.hypot(*[group.total_roll_stiffness / p[name] for name in springs])
    stated = {name: 0.1 * TESTED_STIFFNESS / prior * p[name] for name in springs} | {AXIS: TESTED_AXIS}
    after = predict_sigmas([record], truck.with_stated(stated))[HEIGHT]
    assert remedy.sigma == pytest.approx(after.sigma, rel=1e-6)
    assert remedy.sigma < (1 - AssessmentSettings().min_reduction) * assessment[HEIGHT].sigma
    assert not assessment.sensors, "a complete log needs no other sensor"
    content = json.loads(assessment.to_json())
    assert [p["name"] for p in content["parameters"]] == [p.name for p in assessment.parameters]
    assert content["parameters"][-1]["remedies"][0]["roll_test"] == "semitrailer"
    assert content["logs"] == ["lanes"]
    with pytest.raises(KeyError):
        assessment["tractor.mass"]


@pytest.mark.slow
def test_knowing_a_number_helps_as_predicted(truck, record, assessment):
    """Alone and with another one."""
    one, two = (r for r in predict_sigmas([record], truck, None, KEEN)[HEIGHT].remedies if r.kind == "know")
    assert one.known == two.known[:1] == ("semitrailer.roll_stiffness",)
    for remedy in (one, two):
        after = predict_sigmas([record], truck, OneStage(given=dict.fromkeys(remedy.known, "exact")))[HEIGHT]
        assert remedy.sigma == pytest.approx(after.sigma, rel=1e-6)
        assert remedy.sigma < 0.9 * assessment[HEIGHT].sigma
    assert two.sigma < 0.9 * one.sigma


POSITIONS, PLAY = "semitrailer.*.position", "steer.tractor.front.play"
BUT_PLAY = ("truck", "time_base", "*_rate.*.gain", "*_rate.*.delay", "misalignment", "steer.*.gain", "steer.*.delay")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("parameter", "given", "name", "sigma", "known"),
    [
        (INERTIA, EXACT.given, POSITIONS, "+- 3 cm", "semitrailer.axle_positions"),
        (FRONT, {**dict.fromkeys(BUT_PLAY, "exact"), FRONT: "free"}, PLAY, "+- 0.05 rad", PLAY),
    ],
    ids=["axle positions", "play of the steering"],
)
def test_stating_it_exactly_helps_as_predicted(truck, record, parameter, given, name, sigma, known):
    """Where nothing else limits the estimate. All positions are one remedy."""
    uncertain, exact = (OneStage(given={**given, name: text}, tyres="linear") for text in (sigma, "exact"))
    remedy = first_known(predict_sigmas([record], truck, uncertain, KEEN)[parameter])
    assert remedy.known == (known,)
    assert remedy.sigma == pytest.approx(predict_sigmas([record], truck, exact)[parameter].sigma, rel=1e-6)


@pytest.mark.slow
def test_stating_exact_masses_helps_as_predicted(truck, record):
    """One remedy for the masses of all units: one scale weighs them."""
    masses = {f"{unit.name}.mass": 0.0 for unit in truck.units}
    weighed = truck.with_stated({name: 0.0 for name in truck.parameters() if not name.endswith("mass")})
    of_model = ("softening", "variation", "brakes.drive_axle", "discrepancy")
    settings = replace(EXACT, given=dict.fromkeys(("sensors", "road.*", *of_model), "exact"))
    remedy = first_known(predict_sigmas([record], weighed, settings, KEEN)[FRONT])
    assert remedy.known == (MASS_SCALE,)
    after = predict_sigmas([record], weighed.with_stated(masses), settings)[FRONT]
    assert remedy.sigma == pytest.approx(after.sigma, rel=1e-6)


@pytest.mark.slow
def test_the_same_run_again_helps_as_predicted(truck):
    """A sweep contains more information than a lane change, so another sweep is the best run to add."""
    one, other = (simulate(truck, manoeuvre="sweep", seed=seed, name=str(seed)) for seed in (1, 2))
    both = predict_sigmas([one, other], truck)
    for parameter in predict_sigmas([one], truck, None, AssessmentSettings(enough=1e-6)).parameters:
        for again in (remedy for remedy in parameter.remedies if remedy.kind == "drive"):
            assert again.drive == REPEAT
            assert again.sigma == pytest.approx(both[parameter.name].sigma, rel=0.05)


def test_one_more_lane_change_helps_as_predicted(truck):
    straight = simulate(truck, manoeuvre="straight", duration=20, name="straight")
    both = predict_sigmas([straight, simulate(truck, count=1, seed=8)], truck)
    for parameter in predict_sigmas([straight], truck).parameters:
        (remedy,) = parameter.remedies
        assert (remedy.drive, remedy.known, remedy.channel) == (LANE_CHANGE, (), None)
        assert both[parameter.name].verdict is Verdict.CONVERGED
        assert remedy.sigma == pytest.approx(both[parameter.name].sigma, rel=0.05)


def test_one_more_channel_helps_as_predicted(truck, record):
    without_roll = predict_sigmas([without(record, "roll_rate")], truck)
    height = without_roll[HEIGHT]
    assert (height.verdict, height.correlated_with) == (Verdict.NOT_IDENTIFIABLE, ())
    assert height.sigma < height.prior == quantity_of(HEIGHT).sigma  # yaw rates inform it if the model is right
    (remedy,) = height.remedies
    assert remedy.channel == "roll_rate.semitrailer"
    name = "roll_rate.semitrailer"
    with_roll = without(record, "roll_rate").with_signals({name: record.signals[name]})
    assert remedy.sigma == pytest.approx(predict_sigmas([with_roll], truck)[HEIGHT].sigma, rel=0.05)
    others = [p for p in without_roll.parameters if p.name != HEIGHT]
    assert {p.verdict for p in others} == {Verdict.CONVERGED}


def test_a_straight_run_contains_no_information(truck):
    """Without roll rates the payload height is not identifiable: it needs both a lane change and a channel."""
    straight = simulate(truck, manoeuvre="straight", duration=20)
    for log in (straight, without(straight, "roll_rate")):
        assessment = predict_sigmas([log], truck)
        verdicts = {p.name: p.verdict for p in assessment.parameters}
        without_channel = "roll_rate.semitrailer" not in log.signals
        assert verdicts.pop(HEIGHT) is (Verdict.NOT_IDENTIFIABLE if without_channel else Verdict.NOT_EXCITED)
        assert set(verdicts.values()) == {Verdict.NOT_EXCITED}
        assert sigmas(assessment) == pytest.approx([p.prior for p in assessment.parameters])
        assert all(p.correlated_with == () for p in assessment.parameters)
    (remedy,) = assessment[HEIGHT].remedies
    assert (remedy.drive, remedy.channel) == (LANE_CHANGE, "roll_rate.semitrailer")
    assert remedy.sigma < 0.3


@pytest.mark.slow
def test_settings_of_the_assessment(truck, record, assessment):
    wide = {p.name for p in assessment.parameters if p.sigma > 0.05 * p.value}
    assert {p.name for p in assessment.parameters if p.remedies} <= wide
    for settings, expected in (
        ({"min_reduction": 0.01}, wide),
        ({"enough": 1.0}, set()),
        ({"min_reduction": 0.99}, set()),
    ):
        found = predict_sigmas([record], truck, None, AssessmentSettings(**settings))
        assert {p.name for p in found.parameters if p.remedies} == expected
    assert len(predict_sigmas([record], truck, None, AssessmentSettings(max_remedies=1))[HEIGHT].remedies) == 1
    for p in assessment.parameters:
        assert p.conditional_sigma < p.sigma < p.prior


def test_an_unstable_vehicle_file_gives_a_caution(truck, record):
    """The assessment uses the start of the fit; a vehicle that no stiffness makes stable is refused."""
    unstable = truck.replace({"tractor.drive.cornering_stiffness": 3e5})
    assessment = predict_sigmas([record], unstable)
    assert "unstable from 44 km/h" in assessment.cautions[0]
    assert "stiffness of tractor.drive and semitrailer, where a fit would start" in assessment.cautions[0]
    assert assessment["tractor.drive.cornering_stiffness"].value == 3e5
    assert np.isfinite(sigmas(assessment)).all()
    assert {p.verdict for p in assessment.parameters} == {Verdict.CONVERGED}
    with pytest.raises(VehicleError, match=r"unstable at 24\.4 m/s, however stiff"):
        predict_sigmas([record], truck.replace({"tractor.drive.cornering_stiffness": 2e4}))


def test_faults_of_a_log_are_listed(truck, record):
    inverted = {"yaw_rate.semitrailer": -record.signals["yaw_rate.semitrailer"]}
    with_gap = record.signals["roll_rate.tractor"].copy()
    with_gap[300:420] = np.nan
    assessment = predict_sigmas([record.with_signals({**inverted, "roll_rate.tractor": with_gap})], truck)
    assert [(log, f.signal, f.severity) for log, f in assessment.findings] == [
        ("lanes", "yaw_rate.semitrailer", "error"),
        ("lanes", "roll_rate.tractor", "warning"),
    ]
    assert not any("roll_rate.tractor" in note for note in assessment.notes)
    stationary = record.with_signals({"speed": np.zeros(len(record)), "roll_rate.tractor": with_gap})
    with pytest.raises(SignalError, match=r"(?s)speed: at most 0\.0 m/s.*\n.*roll_rate\.tractor: .*missing"):
        predict_sigmas([stationary], truck)
    with pytest.raises(SignalError, match=r"logs: none given"):
        predict_sigmas([], truck)


@pytest.mark.slow
def test_one_more_sensor_gives_the_sigma_of_a_log_that_has_it(truck, record):
    """The noise of an imagined channel is the default, that of a logged one is estimated: 3 % of the sigma."""
    tractor = {name: values for name, values in record.signals.items() if not name.endswith(".semitrailer")}
    alone = predict_sigmas([replace(record, signals=tractor)], truck, assessment=AssessmentSettings(min_reduction=0.1))
    added = "yaw_rate.semitrailer"
    both = predict_sigmas([replace(record, signals={**tractor, added: record.signals[added]})], truck)
    kept = [p.name for p in both.parameters if p.verdict is Verdict.CONVERGED]
    np.testing.assert_allclose([alone.sensors[added][name] for name in kept], [both[n].sigma for n in kept], rtol=0.03)
    assert {name.split(".")[0] for name in alone.sensors} >= {"articulation", "lateral_acceleration"}
    assert "wheel_speed_difference.semitrailer" in alone.sensors
    without_effect = alone[HEIGHT]
    assert alone.sensors[added][HEIGHT] == pytest.approx(without_effect.prior), "not identifiable even then"
    means = [np.log(list(sigmas.values())).mean() for sigmas in alone.sensors.values()]
    assert means == sorted(means), "the order that the page states"
    page = str(information_document(alone))
    assert "One more sensor: the best of each quantity, in the order of the mean reduction of sigma" in page
    assert "wheel speed" in page


@pytest.mark.slow
def test_the_noise_is_estimated_from_the_logs(truck):
    """At least a tenth of the default; not with `adapt_noise=False`."""
    gyros = article_gyro_variance(["tractor", "semitrailer"])
    loud, noiseless = (simulate(truck, count=2, sensors={n: k * v for n, v in gyros.items()}) for k in (4, 0))
    estimated, lower_limit = (predict_sigmas([log], truck).noise["simulated"] for log in (loud, noiseless))
    for name, variance in gyros.items():
        assert estimated[name] == pytest.approx(4 * variance, rel=0.3)
        assert lower_limit[name] == pytest.approx(variance / 10)
    known = OneStage(adapt_noise=False, noise={"yaw_rate.tractor": 1e-5})
    assert predict_sigmas([loud], truck, known).noise["simulated"] == {**gyros, "yaw_rate.tractor": 1e-5}


def test_settings_without_a_parameter_to_estimate_are_refused(truck, record):
    known = {"cornering_stiffness": "exact", "yaw_inertia": "exact", "payload.height": "exact"}
    with pytest.raises(VehicleError, match="given: every parameter is exact"):
        predict_sigmas([record], truck, OneStage(given=known))
    with pytest.raises(VehicleError, match="no such parameter"):
        predict_sigmas([record], truck, OneStage(given={"tractor.colour": "exact"}))


STATED = [
    ("semitrailer.mass", "33.4 t +- 0.5 %", 167.0, "kg"),
    ("semitrailer.wheelbase", "8 m +- 2 cm", 0.02, "m"),
    ("semitrailer.sprung.roll_yaw_product", "+- 500 kg m^2", 500.0, "kg m^2"),
    ("semitrailer.roll_stiffness", "+- 5 %", 0.05 * 2.7e6, "N m/rad"),
    ("steer.tractor.front.delay", "+- 5 ms", 0.005, "s"),
    ("time_base", "+- 0.1 %", 0.001, "1"),
    ("time_base.main.delay", "+- 5 ms", 0.005, "s"),
    ("road.bank", "+- 1 deg", np.deg2rad(1.0), "rad"),
    ("brakes.drive_axle", "+- 0.2", 0.2, "1"),
    ("discrepancy", "+- 0.02", 0.02, "1"),
]


@pytest.mark.slow
def test_numbers_that_are_stated_are_listed(truck: Vehicle, record: Record) -> None:
    """A fraction of a number that is 0 is nothing: its sigma is in its unit. The tyres of the prediction are linear."""
    given = {name: text for name, text, _, _ in STATED} | {"road.friction": "0.6 +- 5 %"}
    outlook = predict_sigmas([record], truck, OneStage(given=given, tyres="saturating"), checked=True)
    page = str(information_document(outlook))
    assert "±500 kg m²" in page
    for name, _, sigma, unit in STATED:
        found = outlook[name]
        assert (found.prior, found.unit, found.verdict) == (pytest.approx(sigma), unit, Verdict.STATED), name
        assert 0 < found.sigma <= found.prior * (1 + 1e-9)
        assert spoken(name) in page
    note = "road.friction=0.6 +- 5 %: not used, because the tyres of the prediction are linear."
    assert note in outlook.notes
