"""The free-running model beside a log whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.apps.cheng_cebon_2011 import TwoStage
from fifthwheel.apps.cheng_cebon_2011.estimator import free_run_setup
from fifthwheel.data.record import Record
from fifthwheel.estimate.filters.variances import sensor_variance
from fifthwheel.estimate.identify import Fit, OneStage
from fifthwheel.estimate.identify.dataset import LogData, prepare_dataset
from fifthwheel.estimate.identify.fits import (
    FitEvaluation,
    _is_unexplained,
    evaluate_fits,
    free_run_fits,
)
from fifthwheel.estimate.identify.result.display import fit_panel
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle

STEER = "steer.tractor.front"
OUTPUTS = ("yaw_rate.tractor", "yaw_rate.semitrailer", "roll_rate.semitrailer")


@pytest.fixture(scope="module")
def steered(truck: Vehicle) -> Vehicle:
    return truck.with_logged_steering({STEER}, "")


def response(steered: Vehicle, seed: int = 1, count: int = 1) -> Record:
    """Outputs of the linear model without noise, from a moving initial state."""
    record = simulate(steered, count=count, seed=seed, name=f"log {seed}")
    model = dynamics.model(steered, OUTPUTS, roll=True)
    inputs = {name: record.signals[name] for name in ("speed", STEER)}
    x0 = np.array([0.02 if name.startswith("yaw_rate") else 0.0 for name in model.states])
    _, y = free_response(model, dynamics.all_parameters(steered, OUTPUTS), record.time, inputs, x0)
    return replace(record, signals=inputs | {name: y[:, i] for i, name in enumerate(OUTPUTS)})


def free_run(steered: Vehicle, segments: list[Record], values: dict[str, float] | None = None) -> list[Fit]:
    """Fits by the linear truck, of which each log has own offsets."""
    setup = free_run_setup(steered, OUTPUTS, TwoStage(), roll=True)
    return free_run_fits(setup, LogData(name=segments[0].name, segments=segments), values or {}, identified_on=True)


def fits(steered: Vehicle, record: Record, values: dict[str, float] | None = None) -> dict[str, Fit]:
    return {fit.signal: fit for fit in free_run(steered, [record], values)}


@pytest.mark.slow
def test_the_offsets_belong_to_the_log_and_not_to_its_segments(steered: Vehicle) -> None:
    """A bias that jumps between two segments is not explained; one that does not is, and an offset of the steering."""
    record = response(steered)
    middle = record.time[len(record) // 2]
    halves = [record.cut(record.time[0], middle), record.cut(middle + 0.01, record.time[-1])]

    def rms(jump: float) -> float:
        biases = [0.002, 0.002 + jump]
        name = OUTPUTS[1]
        segments = [
            h.with_signals({name: h.signals[name] + b, STEER: h.signals[STEER] + 0.004})
            for h, b in zip(halves, biases, strict=True)
        ]
        return next(fit.rms for fit in free_run(steered, segments) if fit.signal == name)

    assert rms(0.0) < 5e-4
    assert rms(0.008) > 3e-3


def test_gain_and_delay_are_applied(steered: Vehicle) -> None:
    record = response(steered)
    delayed = np.interp(record.time - 0.08, record.time, record.signals[STEER]) / 1.1
    shown = record.with_signals({STEER: delayed})
    right = {f"{STEER}.gain": 1.1, f"{STEER}.delay": 0.08}
    assert min(fit.explained for fit in fits(steered, shown, values=right).values()) > 0.999
    assert max(fit.explained for fit in fits(steered, shown).values()) < 0.97


def test_outliers_and_gaps_do_not_change_the_prediction(steered: Vehicle) -> None:
    record = response(steered)
    gyro = record.signals["yaw_rate.semitrailer"].copy()
    gyro[::50] += 2.0
    gyro[200:230] = np.nan
    clean, result = fits(steered, record), fits(steered, record.with_signals({"yaw_rate.semitrailer": gyro}))
    noise = sensor_variance(steered, "yaw_rate.semitrailer", {}) ** 0.5
    for name in OUTPUTS:  # an outlier pulls as 4 sigma do: 2 % of them move a constant by 0.08 sigma
        assert np.sqrt(np.nanmean((result[name].predicted - clean[name].predicted) ** 2)) < 0.1 * noise
    assert np.isnan(result["yaw_rate.semitrailer"].measured[210])


def test_a_channel_that_is_missing_or_constant_has_no_fit(steered: Vehicle) -> None:
    """Nor one with fewer than three samples."""
    record, name = response(steered), "yaw_rate.tractor"
    zero, missing = np.zeros(len(record)), np.full(len(record), np.nan)
    shown = record.with_signals({"yaw_rate.semitrailer": zero, "roll_rate.semitrailer": missing})
    assert fits(steered, shown).keys() == {name}
    for count in (2, 3):
        kept = np.isin(np.arange(len(record)), (200, 400, 600)[:count])
        few = record.with_signals({name: np.where(kept, record.signals[name], np.nan)})
        assert (name in fits(steered, few)) == (count == 3)


def test_evaluation(steered: Vehicle) -> None:
    """A wrong truck is not trusted; a predicted log does not count for that, but its other speed is noted."""
    settings = TwoStage(check=False)
    record, other = response(steered), response(steered, seed=2)
    faster = other.with_signals({"speed": 1.2 * other.signals["speed"]})
    dataset = prepare_dataset([record], steered, settings, [faster])
    logs = [log.with_noise(steered, OUTPUTS, {}) for log in dataset.logs]

    def evaluation(**values: float) -> FitEvaluation:
        def fits_of(log: LogData, used: bool) -> list[Fit]:
            return [replace(fit, identified_on=used) for fit in free_run(steered, list(log.segments), values)]

        return evaluate_fits(dataset, logs, fits_of, settings)

    right = evaluation()
    assert right.trusted
    assert {(fit.log, fit.identified_on) for fit in right.fits} == {("log 1", True), ("log 2", False)}
    assert right.notes == (
        "log 2: speed from 106 to 106 km/h, identified at 88 to 88 km/h; the understeer may differ there.",
    )
    wrong = evaluation(**{f"{STEER}.gain": -1.0})
    assert not wrong.trusted
    assert any("yaw_rate.tractor: the model explains 0% of its variance in log 1" in note for note in wrong.notes)


def fit_of(signal: str, explained: float, ratio: float, noise: float) -> Fit:
    """A fit of a channel whose variance is so many times that of its noise."""
    measured = np.sqrt(ratio * noise) * np.tile([1.0, 1.0, -1.0, -1.0], 250)
    return Fit(
        log="a", signal=signal, explained=explained, rms=0.0, time=np.arange(1000) * 0.01, measured=measured,
        predicted=measured, identified_on=True,
    )  # fmt: skip


def test_which_channels_are_unexplained(truck: Vehicle) -> None:
    """A clear signal, of which less than half is explained; of a roll rate 20 times as large as its noise."""
    for signal, explained, ratio, unexplained in (
        ("yaw_rate.tractor", 0.0, 4.01, True),
        ("yaw_rate.tractor", 0.0, 3.99, False),
        ("yaw_rate.tractor", 0.39, 5.0, True),  # noise explains a fifth
        ("yaw_rate.tractor", 0.41, 5.0, False),
        ("articulation.semitrailer", 0.39, 5.0, True),
        ("roll_rate.tractor", 0.49, 20.1, True),
        ("roll_rate.tractor", 0.51, 20.1, False),
        ("roll_rate.tractor", 0.0, 19.9, False),
        ("roll.tractor", 0.49, 20.1, True),
        ("roll.tractor", 0.0, 19.9, False),
        ("yaw_rate.tractor", np.nan, 5.0, True),
    ):
        fit = fit_of(signal, explained, ratio, noise=1e-5)
        assert _is_unexplained(fit, truck, OneStage(noise={signal: 1e-5})) == unexplained, (signal, explained, ratio)


def test_a_spike_is_outside_the_axis_of_a_panel() -> None:
    fit = fit_of("yaw_rate.tractor", 1.0, 4.0, noise=1e-4)
    assert fit_panel(fit).y.range is None
    spiked = fit.measured.copy()
    spiked[500] = 10.0
    panel = fit_panel(replace(fit, measured=spiked), title="yaw rate")
    assert panel.y.range is not None
    assert max(np.abs(panel.y.range)) < 3.0  # deg/s
    assert panel.title == "yaw rate (spikes outside the axis)"


def test_explained_fraction_and_rms(steered: Vehicle) -> None:
    """Of the residual, with missing samples left out."""
    record = response(steered)
    noise = 0.02 * np.random.default_rng(3).normal(size=len(record))
    noise[::3] = np.nan
    fit = fits(steered, record.with_signals({"yaw_rate.tractor": record.signals["yaw_rate.tractor"] + noise}))[
        "yaw_rate.tractor"
    ]
    present = np.isfinite(fit.measured)
    residual = (fit.measured - fit.predicted)[present]
    assert fit.rms == pytest.approx(np.sqrt(np.mean(residual**2)))
    assert fit.rms == pytest.approx(0.02, rel=0.1)
    assert fit.explained == pytest.approx(1 - residual.var() / fit.measured[present].var())
    assert present.sum() == len(record) - len(noise[::3])
