"""Time offsets and exchanged gyros of predictions whose lags are known: both sides of every limit."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.time_bases.findings import exchanged_pairs
from fifthwheel.estimate.time_bases.offsets import TimeOffset, common_offsets, offsets_of
from fifthwheel.estimate.time_bases.predictions import RATE, Prediction, lag_curve
from tests.estimate.time_bases.test_lags import TIME, excitation

STEER, YAW, YAW2, ROLL2 = "steer.tractor.front", "yaw_rate.tractor", "yaw_rate.semitrailer", "roll_rate.semitrailer"
ROLL, ANGLE, ACCELERATION = "roll_rate.tractor", "articulation.semitrailer", "lateral_acceleration.tractor"
SOURCES = {name: excitation(k) for k, name in enumerate((YAW, YAW2, ROLL2, ROLL, ANGLE, ACCELERATION))}
WHITE = {name: np.random.default_rng(100 + k).normal(size=TIME.size) for k, name in enumerate(SOURCES)}


def shifted(values, lag, time=TIME):
    return np.interp(time - lag, TIME[: values.size], values)


def prediction_of(measured, variants=None, *, generic=False):
    """A prediction with measured channels; by default one variant without lags."""
    predicted = [{name: SOURCES[name] for name in measured}] if variants is None else variants
    return Prediction(
        time=TIME,
        steer=STEER,
        names=tuple(measured),
        measured=np.column_stack(list(measured.values())),
        predicted=np.array([np.column_stack([variant[name] for name in measured]) for variant in predicted]),
        generic=generic,
    )


def late(lags, noise=0.02):
    """The channels, late by some lags."""
    return {name: shifted(SOURCES[name], lag) + noise * WHITE[name] for name, lag in lags.items()}


def offsets(lags, *, time_bases=None, **options):
    """Offsets of channels with known lags by name."""
    measured = late(lags)
    record = Record(time=TIME, signals={STEER: SOURCES[ANGLE], **measured}, time_bases=time_bases or {})
    return {offset.name: offset for offset in offsets_of(record, prediction_of(measured, **options))}


def test_the_curve_equals_correlations_one_by_one():
    predicted, measured = SOURCES[YAW].copy(), late({YAW: 0.3}, noise=0.5)[YAW]
    measured[300:350] = np.nan
    predicted[:40] = np.nan
    curve = lag_curve(measured, predicted)
    for k, (lag, explained) in enumerate(zip(curve.lags, curve.explained, strict=True)):
        steps = k - 55
        assert lag == pytest.approx(steps / RATE)
        r = np.corrcoef(measured[curve.rows], predicted[curve.rows - steps])[0, 1]
        assert explained == pytest.approx(max(r, 0) ** 2, abs=1e-12)
    possible = [k for k in range(TIME.size) if k - 56 >= 40 and k + 56 < TIME.size and np.isfinite(measured[k])]
    assert curve.rows.tolist() == possible
    negative = [np.corrcoef(measured[curve.rows], predicted[curve.rows - k])[0, 1] for k in range(-8, 9)]
    assert curve.inverted == pytest.approx(max(-min(negative), 0) ** 2)
    upside_down = lag_curve(-measured, predicted)
    assert upside_down.inverted == pytest.approx(max(negative) ** 2)
    gain, sigma, explained = curve.gain()
    best = int(curve.explained.argmax()) - 55
    p, m = predicted[curve.rows - best], measured[curve.rows]
    slope, bias = np.polyfit(p, m, 1)
    assert gain == pytest.approx(slope)
    assert explained == pytest.approx(1 - np.var(m - slope * p - bias) / np.var(m))
    assert 0.5 < sigma / (0.5 / np.sqrt(((p - p.mean()) ** 2).sum())) < 2  # of white noise


def test_too_few_samples_and_maxima_at_the_ends():
    predicted = SOURCES[YAW]
    few = np.full(TIME.size, np.nan)
    few[200:299] = predicted[200:299]
    assert lag_curve(few, predicted) is None
    few[299] = predicted[299]
    assert lag_curve(few, predicted).rows.size == 100
    assert lag_curve(predicted, np.ones(TIME.size)).best() is None
    beyond = lag_curve(shifted(predicted, 2.6), predicted)
    assert beyond.explained.argmax() != 110 or beyond.gain() is None


def test_offsets_are_relative_to_the_yaw_rate_of_the_first_unit():
    found = offsets({YAW: 0.08, YAW2: 0.48, ROLL2: -0.4})
    assert list(found) == [STEER, YAW2, ROLL2]
    assert found[STEER].offset == pytest.approx(-0.08, abs=0.005)
    assert found[YAW2].offset == pytest.approx(0.4, abs=0.005)
    assert found[ROLL2].offset == pytest.approx(-0.48, abs=0.005)
    for offset in found.values():
        assert offset.signals == (offset.name,)
        assert offset.sigma == pytest.approx(0.015, abs=0.002)  # of the model; noise is small
        assert offset.explained > 0.99
    at_zero = np.corrcoef(SOURCES[YAW2][100:-100], shifted(SOURCES[YAW2], 0.4)[100:-100])[0, 1] ** 2
    assert found[YAW2].explained_at_0 == pytest.approx(at_zero, abs=0.05)
    assert [o.smallest for o in found.values()] == [0.25, 0.2, 0.2]
    assert [o.smallest for o in offsets({YAW: 0.0, YAW2: 0.0}, generic=True).values()] == [0.3, 0.3]


def test_sigma_contains_noise_and_the_spread_of_the_vehicle():
    """Two variants that explain the channels alike and differ in their lags by 0.2 s: a spread of 0.1 s."""
    lags = {YAW: 0.0, YAW2: 0.3}
    variants = [{YAW: SOURCES[YAW], YAW2: shifted(SOURCES[YAW2], lag)} for lag in (0.2, -0.2)]
    measured = {YAW: SOURCES[YAW] + 0.02 * WHITE[YAW], YAW2: SOURCES[YAW2] + 0.02 * WHITE[YAW2]}
    record = Record(time=TIME, signals=measured)
    found = {o.name: o for o in offsets_of(record, prediction_of(measured, variants))}
    assert found[YAW2].offset == pytest.approx(0.0, abs=0.02)
    assert found[YAW2].sigma == pytest.approx(np.hypot(0.2, 0.015), rel=0.05)
    assert found[STEER].sigma == pytest.approx(0.015, rel=0.05)
    noisy = {name: shifted(SOURCES[name], lag) + WHITE[name] for name, lag in lags.items()}
    alone = [lag_curve(noisy[name], SOURCES[name]).best()[1] for name in noisy]
    found = {o.name: o for o in offsets_of(record.with_signals(noisy), prediction_of(noisy))}
    assert found[STEER].sigma == pytest.approx(np.hypot(alone[0], 0.015))
    assert found[YAW2].sigma == pytest.approx(np.sqrt(alone[0] ** 2 + alone[1] ** 2 + 0.015**2))


def test_a_variant_counts_by_what_it_explains():
    """Weight exp(2 (m0 - m)) with m the mean logarithm of the unexplained fractions."""
    measured = late({YAW: 0.0, YAW2: 0.0})
    worse = {YAW: SOURCES[YAW], YAW2: shifted(SOURCES[YAW2], 0.4) + 0.15 * WHITE[ROLL]}
    variants = [{YAW: SOURCES[YAW], YAW2: SOURCES[YAW2]}, worse]
    misfit = []
    for variant in variants:
        curves = [lag_curve(measured[name], variant[name]) for name in measured]
        misfit.append(np.mean([np.log(1 - c.explained_at(c.best()[0])) for c in curves]))
    second = np.exp(2 * (misfit[0] - misfit[1]))
    record = Record(time=TIME, signals=measured)
    found = {o.name: o for o in offsets_of(record, prediction_of(measured, variants))}
    assert found[YAW2].offset == pytest.approx(-0.4 * second / (1 + second), abs=0.01)
    assert 0.02 < second < 0.5


@pytest.mark.parametrize(
    ("lags", "expected"),
    [
        ({YAW: 0.5, YAW2: 0.0, ROLL2: 0.0}, {YAW: 0.5, YAW2: 0.0, ROLL2: 0.0}),  # it cannot be late otherwise
        ({YAW: 0.5}, {YAW: 0.5}),
        ({YAW: -0.5, YAW2: -0.5, ROLL2: -0.5}, {STEER: 0.5, YAW2: 0.0, ROLL2: 0.0}),
        ({YAW: -0.5, YAW2: 0.0, ROLL2: 0.0}, {YAW: -0.5, YAW2: 0.0, ROLL2: 0.0}),
        ({YAW: -0.5, YAW2: -0.5, ROLL2: 0.0}, {STEER: 0.5, YAW2: 0.0, ROLL2: 0.5}),
        ({YAW: -0.5}, {STEER: 0.5}),
        ({YAW: -0.28, YAW2: -0.28}, {STEER: 0.28, YAW2: 0.0}),
        ({YAW: 0.28, YAW2: 0.28}, {YAW: 0.28, YAW2: 0.28}),
        ({YAW: 0.23, YAW2: 0.23}, {STEER: -0.23, YAW2: 0.0}),
        ({YAW: 0.23, YAW2: 0.0}, {YAW: 0.23, YAW2: 0.0}),
        ({YAW: 0.17, YAW2: 0.0}, {STEER: -0.17, YAW2: -0.17}),
        ({YAW: 0.23, YAW2: 0.23, ROLL2: 0.0}, {STEER: -0.23, YAW2: 0.0, ROLL2: -0.23}),
        ({YAW2: 0.5, ROLL2: 0.1}, {YAW2: 0.5, ROLL2: 0.1}),
    ],
    ids=lambda value: " ".join(f"{name}={lag}" for name, lag in value.items()),
)
def test_which_of_steer_angle_and_yaw_rate_is_late(lags, expected):
    found = offsets(lags)
    assert {name: offset.offset for name, offset in found.items()} == {
        name: pytest.approx(value, abs=0.01) for name, value in expected.items()
    }


def test_a_yaw_rate_of_another_time_base_may_be_early():
    lags = {YAW: -0.5, YAW2: -0.5, ROLL2: -0.5}
    assert STEER in offsets(lags, time_bases=dict.fromkeys((STEER, *lags), "bus"))
    assert YAW in offsets(lags, time_bases=dict.fromkeys(lags, "bus"))


@pytest.mark.parametrize(("explained", "used"), [(0.25, False), (0.35, True)])
def test_a_channel_needs_an_explained_fraction(explained, used):
    """0.3 of its variance."""
    noise = np.sqrt(1 / explained - 1) * WHITE[YAW2] / np.std(WHITE[YAW2])
    measured = late({YAW: 0.0}) | {YAW2: SOURCES[YAW2] + noise}
    record = Record(time=TIME, signals=measured)
    assert (YAW2 in {o.name for o in offsets_of(record, prediction_of(measured))}) == used
    swapped = {YAW: SOURCES[YAW] + np.sqrt(1 / explained - 1) * WHITE[YAW] / np.std(WHITE[YAW])} | late({YAW2: 0.0})
    found = offsets_of(record.with_signals(swapped), prediction_of(swapped))
    assert bool(found) == used  # the reference does not show


def offset_of(name, offset, sigma=0.02, smallest=0.2):
    return TimeOffset(
        name=name, signals=(name,), offset=offset, sigma=sigma, explained_at_0=0.2, explained=0.8, smallest=smallest
    )


def test_similar_offsets_are_one():
    """Up to 0.1 s apart, weighted by 1 / sigma^2."""
    one, other = offset_of(YAW2, 0.4, 0.01), offset_of(ROLL2, 0.49, 0.03, smallest=0.25)
    other = replace(other, explained=0.4, explained_at_0=0.1)
    (joined,) = common_offsets([one, other])
    assert (joined.name, joined.signals, joined.smallest) == (YAW2, (YAW2, ROLL2), 0.25)
    for field in ("offset", "sigma", "explained", "explained_at_0"):
        mean = 0.9 * getattr(one, field) + 0.1 * getattr(other, field)
        assert getattr(joined, field) == pytest.approx(mean)
    assert [o.name for o in common_offsets([one, offset_of(ROLL2, 0.51)])] == [YAW2, ROLL2]
    assert common_offsets([offset_of(YAW2, 0.19), offset_of(ROLL2, 0.3, sigma=0.11)]) == []


def crossed(names, *, lag=0.0, explained=0.99, own=0.0):
    """Two channels that follow each other's prediction, and partly their own."""
    one, other = names
    noise = np.sqrt(1 / explained - 1)
    measured = {}
    for name, source in ((one, other), (other, one)):
        pure = (1 - own) * shifted(SOURCES[source], lag) + own * shifted(SOURCES[name], lag)
        measured[name] = pure / np.std(pure) + noise * WHITE[name] / np.std(WHITE[name])
    return list(exchanged_pairs(prediction_of(measured)))


@pytest.mark.parametrize(("names", "least", "too_late"), [((YAW, YAW2), 0.9, 0.3), ((ROLL, ROLL2), 0.5, 0.6)])
def test_exchanged_channels(names, least, too_late):
    """Explained by each other's prediction, by 0.9 of a yaw rate and 0.5 of a roll rate, with a lag up to 0.12 s."""
    assert crossed(names) == [names]
    assert crossed(names, explained=least + 0.02) == [names]
    assert crossed(names, explained=least - 0.02) == []
    assert crossed(names, lag=0.12) == crossed(names, lag=-0.12) == [names]
    assert crossed(names, lag=too_late) == crossed(names, lag=-too_late) == []
    assert crossed(names, own=1.0) == []
    assert crossed((YAW, ROLL2)) == []


@pytest.mark.parametrize(("names", "margin"), [((YAW, YAW2), 1.0), ((ROLL, ROLL2), 0.3)])
def test_an_exchange_needs_a_margin(names, margin):
    """Of the logarithms of the residual variances, summed: similar predictions, and mixtures of them as channels."""
    one, other = names
    expected = {one: SOURCES[one], other: 0.97 * SOURCES[one] + 0.24 * SOURCES[other]}
    differences, found = [], []
    for own in np.linspace(0.0, 0.5, 41):
        measured, straight, cross = {}, 0.0, np.zeros(7)
        for name, source in (names, names[::-1]):
            measured[name] = (1 - own) * expected[source] + own * expected[name] + 0.1 * WHITE[name]
            straight += np.log(1 - lag_curve(measured[name], expected[name]).explained.max())
            cross += np.log(1 - lag_curve(measured[name], expected[source]).explained[52:59])  # lags up to 0.12 s
        differences.append(straight - cross.min())
        found.append(bool(list(exchanged_pairs(prediction_of(measured, [expected])))))
    assert found == [difference > margin for difference in differences]
    assert 0 < sum(found) < 41


@pytest.mark.parametrize("missing", [0, 300])
def test_sigma_is_that_of_scores_in_blocks_of_four_seconds(missing):
    """The equation of `LagCurve.best`, with least squares by NumPy; of few blocks wider by sqrt(B / (B - 3))."""
    predicted = SOURCES[YAW2]
    measured = 1.3 * shifted(predicted, 0.2) + 0.4 * WHITE[YAW2]
    measured[400 : 400 + missing] = np.nan
    curve = lag_curve(measured, predicted)
    lag, sigma = curve.best()
    k, rows = int(curve.explained.argmax()) - 55, curve.rows
    assert lag == pytest.approx(k / RATE, abs=0.5 / RATE)
    p = predicted[rows - k]
    slope = (predicted[rows - k + 1] - predicted[rows - k - 1]) / (2 / RATE)
    regressors = np.column_stack([p, np.ones(rows.size)])
    (gain, _), *_ = np.linalg.lstsq(regressors, measured[rows], rcond=None)
    slope = slope - regressors @ np.linalg.lstsq(regressors, slope, rcond=None)[0]
    every = np.column_stack([regressors, slope])
    residual = measured[rows] - every @ np.linalg.lstsq(every, measured[rows], rcond=None)[0]
    blocks = {}
    for row, score in zip(rows, gain * slope * residual, strict=True):
        blocks[row // 100] = blocks.get(row // 100, 0.0) + score
    few = len(blocks) / (len(blocks) - 3)
    variance = few * sum(score**2 for score in blocks.values()) / (gain**2 * (slope @ slope)) ** 2
    assert sigma == pytest.approx(np.sqrt(variance))
    assert len(blocks) == 15 - missing // 100
