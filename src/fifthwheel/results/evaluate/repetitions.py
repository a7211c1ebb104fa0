"""Manoeuvres that a log repeats: where they are, and the mean of a measure over them with its sigma.

A manoeuvre is where the steer angle differs from that of the straight entry by more than `ACTIVE` of its largest value.
Signals are smoothed by local polynomials (Savitzky and Golay, 1964), which keep peaks, and count from their mean before
the manoeuvre. Sigma is the larger one of the scatter of the repetitions and of the sensor noise, by `DRAWS` manoeuvres
with simulated noise (B. Efron and R. Tibshirani, An Introduction to the Bootstrap, 1993), which also give the bias that
noise causes in a largest value. It is removed; it is as uncertain as it is large, so it is in sigma too.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fifthwheel.base.errors import SignalError
from fifthwheel.base.formatting import approximate, enumerated, with_sigma
from fifthwheel.base.names import split_kind
from fifthwheel.base.types import Array
from fifthwheel.data.channels import SignalName
from fifthwheel.results.evaluate.evaluation import EvaluatedMeasure, MethodResult
from fifthwheel.results.evaluate.motion import MeasuredMotion, gain_unit
from fifthwheel.truck.spoken_names import named

ACTIVE = 0.1
"""Fraction of the largest steer angle from which the truck is steered."""
SMALLEST = float(np.radians(0.2))
"""Least steer angle of a manoeuvre, rad."""
ENTRY = 1.0
"""Time straight ahead before a manoeuvre, whose mean is the offset of a signal, s."""
LEAST_ENTRY = 0.4
"""The same at least, s."""
JOINED = 0.5
"""Longest time without steering within a manoeuvre, s."""
WIDTH = 0.3
"""Of the local polynomials, s."""
LARGE = 0.5
"""Fraction of the largest steer angle above which steering is more than a correction."""
DRAWS = 40
CHANCE, LEAST = 0.01, 0.01
"""Of a difference of left and right: fraction of the logs of a symmetrical truck that have one, and of the mean."""


@dataclass(frozen=True, kw_only=True)
class Response:
    """One manoeuvre: signals (N,) without their offset, smoothed, from the straight entry to the next manoeuvre."""

    time: Array
    """From the first steering, s."""
    steer: Array
    outputs: Mapping[str, Array]
    units: tuple[str, ...]
    end: float
    """Time of the last steering, s."""
    noise: Mapping[str, float]
    """Standard deviation of the noise that remains after smoothing, by signal; "steer" too."""

    @property
    def is_left(self) -> bool:
        """Whether it begins to the left."""
        return bool(self.lobes[0][0] > 0)

    @property
    def lobes(self) -> list[Array]:
        """The steer angle from one change of sign to the next, while the truck is steered, if above 0.3 of its peak."""
        steered = self.steer[(self.time >= 0) & (self.time <= self.end)]
        parts = np.split(steered, np.flatnonzero(np.diff(np.sign(steered))) + 1)
        return [part for part in parts if np.abs(part).max() > 0.3 * np.abs(steered).max()]


def crossing(time: Array, values: Array, level: float) -> float:
    """First time at which values (N,) rise through a level, s, between samples; NaN if they do not."""
    rows = np.flatnonzero((values[:-1] < level) & (values[1:] >= level))
    if not rows.size:
        return float("nan")
    k = rows[0]
    return float(time[k] + (level - values[k]) / (values[k + 1] - values[k]) * (time[k + 1] - time[k]))


class Words(NamedTuple):
    """Title and unit of a measure; the unit None is that of a gain."""

    title: str
    unit: str | None


class RepeatedManoeuvre(NamedTuple):
    """A manoeuvre that a test repeats."""

    fault: Callable[[Response], str]
    """Why a response is not of this manoeuvre; "" if it is."""
    measures: Callable[[Response], Mapping[str, float]]
    """Values by name, the first word of which is a key of `words`; NaN where a response does not have one."""
    words: Mapping[str, Words]
    """Title and unit of the measures."""


def findings(motion: MeasuredMotion, outputs: Sequence[str], manoeuvre: RepeatedManoeuvre) -> MethodResult:
    """The measures of all manoeuvres of a log that have no fault, from these outputs.

    Raises:
        SignalError: most manoeuvres of the log have a fault, or it does not begin straight ahead.
    """
    stated = {"steer": motion.noise(motion.steer_name), **{name: motion.noise(name) for name in outputs}}
    noise = {name: sigma or 0.0 for name, sigma in stated.items()}
    times = _manoeuvres(motion)
    responses = [_smoothed(response, noise) for response in _raw(motion, times, outputs)]
    fault, measure, words = manoeuvre
    faults = [fault(response) for response in responses]
    good = [k for k, text in enumerate(faults) if not text]
    if not good:
        raise SignalError(f"{motion.steer_name}: {faults[0]} in {motion.name}; give the log of this test")
    kept = [responses[k] for k in good]
    _require_mostly_good(motion, responses, faults)
    values, biases, draws = _repeated(kept, noise, measure)
    measures = [
        _measure(name, values[name], biases[name], draws[name], words=words, outputs=outputs) for name in values
    ]
    if len(good) == 1 and None in stated.values():
        measures = [replace(m, sigma=None, reason="too short a log for the sensor noise") for m in measures]
    missing = [_title(name, words) for name in measure(kept[0]) if name not in values]
    steered = {motion.steer_name: motion.steer, **{name: motion.signals[name] for name in outputs}}
    remaining = {name: np.nan if stated[name] is None else sigma for name, sigma in kept[0].noise.items()}
    return MethodResult(
        measures=tuple(measures),
        arrays={"time": motion.time, **{name: smoothed(values, motion.rate) for name, values in steered.items()}},
        start=float(motion.time[times[good[0]][0]]),
        noise={motion.steer_name: remaining.pop("steer"), **remaining},
        notes=(*_notes(kept, [text for text in faults if text], missing), *_sides(kept, measures, values, draws)),
    )


def _require_mostly_good(motion: MeasuredMotion, responses: Sequence[Response], faults: Sequence[str]) -> None:
    """Raise where as many large steering inputs have a fault as have none: chance resemblances in another test."""
    peaks = [float(np.abs(response.steer).max()) for response in responses]
    large = [text for text, peak in zip(faults, peaks, strict=True) if peak > LARGE * max(peaks)]
    wrong = [text for text in large if text]
    if 2 * len(wrong) >= len(large):
        raise SignalError(
            f"{motion.steer_name}: {len(wrong)} of {len(large)} steering inputs of {motion.name} are not this test: "
            f"{wrong[0]}; give the log of this test, or cut the record to it"
        )


def _repeated(
    responses: Sequence[Response], noise: Mapping[str, float], measure: Callable[[Response], Mapping[str, float]]
) -> tuple[dict[str, Array], dict[str, Array], dict[str, Array]]:
    """Each measure of each repetition, (n,), its bias by the noise, (n,), and with simulated noise, (n, DRAWS)."""
    rng = np.random.default_rng(0)
    centres = [_smoothed(response, noise, 2 * WIDTH) for response in responses]  # with less of the log's own noise
    found = [measure(response) for response in responses]
    without_noise = [measure(_smoothed(centre, noise)) for centre in centres]
    with_noise = [[measure(_smoothed(_noisy(centre, noise, rng), noise)) for _ in range(DRAWS)] for centre in centres]
    values, biases, draws = dict[str, Array](), dict[str, Array](), dict[str, Array]()
    for name in found[0]:
        drawn = np.array([[draw[name] for draw in repetition] for repetition in with_noise])
        value, exact = (np.array([one[name] for one in ones]) for ones in (found, without_noise))
        if np.isfinite(value + exact).all() and (np.isfinite(drawn).mean(axis=1) > 0.5).all():
            values[name], biases[name], draws[name] = value, np.nanmean(drawn, axis=1) - exact, drawn
    return values, biases, draws


def _notes(responses: Sequence[Response], faults: Sequence[str], missing: Iterable[str]) -> Iterator[str]:
    """How often and to which side the manoeuvre was driven, and what was left out."""
    n, left = len(responses), sum(response.is_left for response in responses)
    yield f"{n} manoeuvre{'s' * (n > 1)}: {left} to the left, {n - left} to the right."
    if n == 1:
        yield "Sigma has the sensor noise only, and no scatter, which needs more manoeuvres."
    if faults:
        yield f"{len(faults)} more left out: {enumerated(faults)}."
    if titles := list(missing):
        yield f"Not determined, because of noise or no such instant: {enumerated(titles)}."


def _sides(
    responses: Sequence[Response],
    measures: Sequence[EvaluatedMeasure],
    values: Mapping[str, Array],
    draws: Mapping[str, Array],
) -> Iterator[str]:
    """The measures whose means to the left and to the right differ significantly, by Student's t of their scatter and
    by the noise, and by `LEAST` of their mean; by chance in `CHANCE` of the logs. Each side needs two or more."""
    from scipy.special import ndtri, stdtrit  # slow to import

    left = np.array([response.is_left for response in responses])
    sides, n = (left, ~left), len(left)
    if min(side.sum() for side in sides) < 2:
        return
    certain = 1 - CHANCE / 2 / max(len(measures), 1)
    found = []
    for measure in measures:
        value = values[measure.name]
        difference = value[left].mean() - value[~left].mean()
        squares = sum(float(np.var(value[side])) * side.sum() for side in sides) / (n - 2)
        scatter = np.sqrt(squares * sum(1 / side.sum() for side in sides))
        noise = np.sqrt(sum(np.mean(np.nanvar(draws[measure.name][side], axis=1)) / side.sum() for side in sides))
        least = LEAST * abs(value.mean())
        if abs(difference) > max(stdtrit(n - 2, certain) * scatter, ndtri(certain) * noise, least):
            found.append(f"{measure.title} {with_sigma(difference, max(scatter, noise), measure.unit)}")
    if found:
        yield f"Left less right, significant: {enumerated(found)}: uneven steering, load to one side, bank or wind."


def _title(name: str, words: Mapping[str, Words]) -> str:
    kind, signal = split_kind(name)
    return f"{words[kind].title}, {named(signal).removeprefix('the ')}" if signal else words[kind].title


def _measure(
    name: str, values: Array, biases: Array, draws: Array, *, words: Mapping[str, Words], outputs: Sequence[str]
) -> EvaluatedMeasure:
    """Mean over the repetitions (n,) without their bias (n,), and sigma; draws (n, DRAWS) with simulated noise."""
    kind, signal = split_kind(name)
    unit = words[kind].unit or gain_unit(signal)
    n, bias = len(values), float(biases.mean())
    by_noise = np.sqrt(np.mean(np.nanvar(draws, axis=1)) / n)
    scatter = np.std(values, ddof=1) / np.sqrt(n) if n > 1 else 0.0
    sigma = float(np.hypot(max(by_noise, scatter), bias))
    used = [signal] if signal else [o for o in outputs if kind.endswith(SignalName.of(o).quantity)] or outputs
    return EvaluatedMeasure(name, _title(name, words), unit, float(values.mean()) - bias, sigma, tuple(used))


def _manoeuvres(motion: MeasuredMotion) -> list[tuple[int, int]]:
    entry = round(LEAST_ENTRY * motion.rate)
    steer = smoothed(motion.steer, motion.rate)
    deviation = np.abs(steer - steer[:entry].mean())
    if deviation.max() < SMALLEST:
        raise SignalError(
            f"{motion.steer_name}: within {approximate(deviation.max(), 'rad')} in {motion.name}, at least "
            f"{approximate(SMALLEST, 'rad')} needed; give the log of a manoeuvre, or check its unit"
        )
    steered = np.flatnonzero(deviation > ACTIVE * deviation.max())
    if steered[0] < entry:
        raise SignalError(
            f"{motion.steer_name}: the steering begins {steered[0] / motion.rate:.2f} s after the start of "
            f"{motion.name}, at least {LEAST_ENTRY:g} s straight ahead needed; cut the record to begin earlier"
        )
    parts = np.split(steered, np.flatnonzero(np.diff(steered) > JOINED * motion.rate) + 1)
    return [(int(part[0]), int(part[-1])) for part in parts]


def _raw(motion: MeasuredMotion, found: Sequence[tuple[int, int]], outputs: Sequence[str]) -> Iterator[Response]:
    """Each manoeuvre as measured, by its first and last sample of steering."""
    stops = [*(first for first, _ in found[1:]), len(motion.time)]
    before = 0
    for (first, last), stop in zip(found, stops, strict=True):
        rows = slice(max(before, first - round(ENTRY * motion.rate)), stop)
        yield Response(
            time=motion.time[rows] - motion.time[first],
            steer=motion.steer[rows],
            outputs={name: motion.signals[name][rows] for name in outputs},
            units=motion.units,
            end=float(motion.time[last] - motion.time[first]),
            noise={},
        )
        before = last + 1


def smoothed(values: Array, rate: float, width: float = WIDTH) -> Array:
    """Values (N,) smoothed by local cubic polynomials of a width, s."""
    from scipy.signal import savgol_filter  # slow to import

    size = min(max(2 * round(width * rate / 2) + 1, 5), len(values) - 1 + len(values) % 2)
    return np.asarray(savgol_filter(values, size, 3)) if size >= 5 else values


def _smoothed(raw: Response, noise: Mapping[str, float], width: float = WIDTH) -> Response:
    rate = 1 / float(raw.time[1] - raw.time[0])
    entry = raw.time < -1.5 / rate

    def signal(values: Array) -> Array:
        return np.asarray(smoothed(values, rate, width) - values[entry].mean())

    impulse = np.zeros(2 * round(rate) + 1)
    impulse[len(impulse) // 2] = 1.0
    kept = float(np.linalg.norm(smoothed(impulse, rate, width)))
    return replace(
        raw,
        steer=signal(raw.steer),
        outputs={name: signal(values) for name, values in raw.outputs.items()},
        noise={name: kept * sigma for name, sigma in noise.items()},
    )


def _noisy(smooth: Response, noise: Mapping[str, float], rng: np.random.Generator) -> Response:

    def signal(values: Array, name: str) -> Array:
        return values + noise[name] * rng.normal(size=values.size)

    outputs = {name: signal(values, name) for name, values in smooth.outputs.items()}
    return replace(smooth, steer=signal(smooth.steer, "steer"), outputs=outputs)
