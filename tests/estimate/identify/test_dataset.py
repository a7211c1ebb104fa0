"""Logs and vehicle before an identification: what is refused, what is noted, what is left alone."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import OneStage, identify
from fifthwheel.estimate.identify.dataset import prepare_dataset
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle
from tests.estimate.conftest import without

KNOWN = OneStage(tyres="linear", given={"others": "exact", "sensors": "exact"})
FRONT, REAR = "steer.tractor.front", "steer.semitrailer.rear"
STIFFNESS_AND_INERTIA = (
    *(f"{group}.cornering_stiffness" for group in ("tractor.front", "tractor.drive", "semitrailer")),
    "semitrailer.yaw_inertia",
)


def copy(record: Record) -> Record:
    signals = {name: values.copy() for name, values in record.signals.items()}
    return replace(record, time=record.time.copy(), signals=signals)


@pytest.mark.slow
def test_identification_changes_none_of_its_arguments(truck: Vehicle) -> None:
    """And so the same call has the same result, bit by bit."""
    records = [simulate(truck, count=1, seed=seed, name=f"log {seed}") for seed in (1, 2)]
    speed = records[0].signals["speed"].copy()
    speed[100] += 10.0  # a spike that is removed
    records[0] = records[0].with_signals({"speed": speed})
    given, vehicle = [copy(record) for record in records], truck.model_copy(deep=True)
    results = [identify(records[:1], truck, KNOWN, validate=records[1:]) for _ in range(2)]
    assert records == given
    assert truck == vehicle
    assert results[0].to_json() == results[1].to_json()
    for name, history in results[0].histories.items():
        assert history.values.tobytes() == results[1].histories[name].values.tobytes()
    assert results[0].fits[-1].predicted.tobytes() == results[1].fits[-1].predicted.tobytes()


def test_dataset(truck: Vehicle) -> None:
    slow = simulate(truck, count=1, seed=1, name="slow")
    speed = slow.signals["speed"].copy()
    speed[300:350] = 2.0
    other = simulate(truck, count=1, seed=2, name="other")
    given = slow.with_signals({"speed": speed})
    dataset = prepare_dataset([given], truck, OneStage(given={"tractor.mass": "exact"}, relaxation=False), [other])
    (log,), (validation,) = dataset.logs, dataset.validation
    assert [len(segment) for segment in log.segments] == [300 // 4, -(-(len(slow) - 350) // 4)]
    assert (log.name, validation.name, dataset.records) == ("slow", "other", (given,))
    assert dataset.yaw == ("yaw_rate.tractor", "yaw_rate.semitrailer")
    assert dataset.roll == ("roll_rate.tractor", "roll_rate.semitrailer")
    assert dataset.vehicle.steer_signals() == (FRONT,)
    assert dataset.initial_vehicle.steer_signals() == truck.steer_signals()
    assert all(dataset.vehicle.parameters()[f"{path}.relaxation_length"] == 0 for path in truck.group_paths())
    assert any(REAR in note and "assumed to be 0" in note for note in dataset.notes)
    assert "tractor.mass: given as exact, so no sigma includes its uncertainty." in dataset.notes
    source = dataset.identified_vehicle({"semitrailer.yaw_inertia": 4.0e5}).source
    assert "identified from slow at 24.4 to 24.4 m/s" in source
    height = "semitrailer.sprung.cog_height"
    for value, limited in ((0.1, 0.2), (1.3, 1.3), (6.0, 5.0)):  # to the range of a vehicle file
        assert dataset.identified_vehicle({height: value}).parameters()[height] == limited


def test_a_log_of_which_the_vehicle_was_identified_counts_twice(truck: Vehicle) -> None:
    first, second = (replace(simulate(truck, count=1, seed=k), name=f"run_{k}") for k in (1, 2))
    identified = prepare_dataset([first], truck, OneStage()).identified_vehicle({})
    notes = prepare_dataset([first, second], identified, OneStage()).notes
    assert [note for note in notes if "counts twice" in note] == [
        "run_1: the vehicle file is identified from a log of this name; if it is the same, it counts twice: begin with "
        "the file before, or with other logs."
    ]
    assert not any("counts twice" in note for note in prepare_dataset([second], identified, OneStage()).notes)


def test_noise_of_a_log(truck: Vehicle) -> None:
    """Its own, else that of the settings, else that of the table."""
    dataset = prepare_dataset([simulate(truck, count=1)], truck, OneStage())
    log = replace(dataset.logs[0], noise={"yaw_rate.tractor": 1.0}, autocorrelation_factor={"yaw_rate.tractor": 3.0})
    full = log.with_noise(truck, (*dataset.yaw, *dataset.roll), {"yaw_rate.tractor": 2.0, "roll_rate.tractor": 2.0})
    assert full.noise["yaw_rate.tractor"] == 1.0
    assert full.noise["roll_rate.tractor"] == 2.0 / 4  # of the mean of four samples
    assert 0 < full.noise["yaw_rate.semitrailer"] < 1e-3
    assert full.effective_variance("yaw_rate.tractor") == 3.0
    assert full.effective_variance("roll_rate.tractor") == 2.0 / 4
    assert set(log.noise) == {"yaw_rate.tractor"}


def test_refused_logs(truck: Vehicle) -> None:
    record = simulate(truck, count=1, name="one")
    crawling = replace(record.with_signals({"speed": 0 * record.time + 1.0}), name="crawling")
    alternating = record.with_signals({"speed": np.where(np.arange(len(record)) % 2, 4.0, 6.0)})
    cases = [
        ([], [], "logs: none given"),
        ([record], [record], "logs: one given more than once"),
        ([record, replace(record, name="two")], [], "logs: two logs contain the same samples"),
        ([without(record, "steer")], [], FRONT),
        ([without(record, "speed")], [], "speed"),
        ([without(record, "yaw_rate")], [], r"yaw_rate\.tractor: in none of the logs"),  # roll rates are not enough
        ([record], [crawling], "speed: "),
        ([alternating], [], "never at 5 m/s or above for two samples"),
    ]
    for records, validate, message in cases:
        with pytest.raises(SignalError, match=message):
            prepare_dataset(records, truck, OneStage(check=False), validate)


def test_a_steered_trailer(truck: Vehicle) -> None:
    """A log with a steered trailer is used as such; a log without its steer angle is refused beside it."""
    record, other = (simulate(truck, count=1, seed=seed, name=name) for seed, name in ((1, "steered"), (2, "other")))
    log = record.with_signals({REAR: 0.3 * record.signals[FRONT]})
    dataset = prepare_dataset([log], truck, OneStage(check=False))
    assert not any(REAR in note for note in dataset.notes)
    assert dataset.vehicle.steer_signals() == (FRONT, REAR)
    for logs, validate in (([log], [other]), ([log, other], [])):
        with pytest.raises(SignalError, match=r"steer\.semitrailer\.rear: not in other, but in another log"):
            prepare_dataset(logs, truck, OneStage(check=False), validate)


@pytest.mark.slow
def test_one_channel_of_any_unit_is_enough(truck: Vehicle) -> None:
    """The trailer pulls at the fifth wheel; the fit with tyres that saturate had a friction that is not a number."""
    record = simulate(truck, count=2, seed=4)
    kept = {n: values for n, values in record.signals.items() if n in ("speed", FRONT, "yaw_rate.semitrailer")}
    guess = truck.replace({path: 0.85 * truck.parameters()[path] for path in STIFFNESS_AND_INERTIA})
    settings = OneStage(tyres="saturating", given={"others": "exact"})
    result = identify([replace(record, signals=kept)], guess, settings)
    for e in map(result.__getitem__, STIFFNESS_AND_INERTIA):
        assert e.verdict is Verdict.CONVERGED
        assert e.sigma is not None
        assert 0 < e.sigma < 0.2 * e.value
        assert abs(e.value - truck.parameters()[e.name]) < 3 * e.sigma, e.name
    assert result["semitrailer.payload.height"].verdict is Verdict.NOT_IDENTIFIABLE


def test_a_channel_without_samples_counts_as_absent(truck: Vehicle) -> None:
    """It made the payload height converged, which its roll rate alone determines."""
    name, record = "roll_rate.semitrailer", simulate(truck, count=1)
    empty = record.with_signals({name: np.full(len(record), np.nan)})
    absent = replace(record, signals={n: values for n, values in record.signals.items() if n != name})
    dataset, expected = (prepare_dataset([r], truck, OneStage(check=False)) for r in (empty, absent))
    assert dataset.outputs == expected.outputs == tuple(n for n in expected.outputs if n != name)
    assert [segment.signals.keys() for segment in dataset.logs[0].segments] == [
        segment.signals.keys() for segment in expected.logs[0].segments
    ]
    assert [note for note in dataset.notes if note not in expected.notes] == [
        f"simulated: {name}: no samples; it counts as absent. Map another column."
    ]
    assert empty.notes == ()


@pytest.mark.parametrize("name", ["speed", FRONT])
def test_an_input_without_samples_is_refused(truck: Vehicle, name: str) -> None:
    record = simulate(truck, count=1)
    with pytest.raises(SignalError, match=f"^{name}: 0 samples in"):
        prepare_dataset([record.with_signals({name: np.full(len(record), np.nan)})], truck, OneStage())


def test_an_axle_whose_position_alone_is_stated_is_noted(truck: Vehicle) -> None:
    """It moves without the others of its group."""
    record = simulate(truck, count=1)
    paths = [f"semitrailer.{axle}.position" for axle in ("front", "middle", "rear")]

    def notes(stated: list[str]) -> list[str]:
        vehicle = truck.with_stated(dict.fromkeys(stated, 0.4))
        return [note for note in prepare_dataset([record], vehicle, OneStage()).notes if "do not move together" in note]

    assert notes(paths) == notes([]) == notes(["tractor.front.position"]) == []
    (note,) = notes(paths[:1])
    assert note.startswith(f"{paths[0]}: stated with a standard deviation, {paths[1]}, {paths[2]} not")
