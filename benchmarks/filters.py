"""Nonlinear Kalman filters of the model with saturating tyres, compared on the nonlinear truck.

    python benchmarks/filters.py             # writes filters.md beside this file; needs a C compiler

Single sines of the steer angle and double lane changes with a driver, up to the limits of adhesion, with the sensors of
the article. All filters have the vehicle file, the noise, the gate and the monitor of the observer:

* linear: the observer with linear tyres, a linear Kalman filter;
* extended: the observer with saturating tyres;
* unscented: the filters of unscented.py.

Cells are the rms error of the sideslip of tractor and trailer in degrees, the percentage of the samples of both whose
error is within the 90 % interval of the filter, and the mean NIS. They are of three seeds of the noise.
"""

import ctypes
import subprocess
import tempfile
import time
from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.native.c_code import function
from fifthwheel.base.types import Array
from fifthwheel.data.record import Record
from fifthwheel.estimate.filters.model import packed_size, unpack_array
from fifthwheel.estimate.observe import Observer, ObserverSettings, monitor, offline
from fifthwheel.estimate.observe.observer_model import ObserverModel
from fifthwheel.estimate.stream import stream_segments
from fifthwheel.model.manoeuvres.courses import STANDARD_SPEED, Course, LaneChange
from fifthwheel.model.manoeuvres.open_loops import single_sine
from fifthwheel.model.plant import Plant, PlantRun, Properties, Sensor, article_sensors, measure
from fifthwheel.truck import Vehicle
from limits import PEAK, SIGNALS, UNITS
from trust_runs import TRUCK, table
from unscented import UnscentedModel

Filter = Literal["linear", "extended", "covariance", "square root"]
FILTERS: dict[Filter, str] = {"linear": "linear", "extended": "extended", "covariance": "unscented"}
"""The filters of the tables, and their titles."""
NONLINEAR: dict[Filter, str] = {
    "extended": "extended",
    "covariance": "unscented, P",
    "square root": "unscented, square root of P",
}
FREQUENCY = 0.4
"""Of the steering, Hz."""
CASES = tuple((1.0, a) for a in (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)) + tuple((0.35, a) for a in (0.5, 1.0, 1.5, 2.0))
"""Factor of the friction, and lateral acceleration of the front axle, m/s^2."""
ACCELEROMETERS = tuple(f"lateral_acceleration.{unit}" for unit in UNITS)
NOISE = dict.fromkeys(ACCELEROMETERS, 0.05**2)
"""Variance of the accelerometers, (m/s^2)^2; the gyros have that of the article."""
EXACT = ObserverSettings(bank=0.0, steer_offset=0.0)
SEEDS = 3
NINETY_PERCENT = 1.645
"""Half of the 90 % interval in standard deviations."""


class Setting(NamedTuple):
    """What the filters have and know."""

    settings: ObserverSettings
    friction: float = 1.0  # factor of the friction of the observer
    accelerometers: float | None = None  # their offset on tractor and, with the other sign, trailer, m/s^2
    start: float = 0.0  # of the log, s


SETTINGS = {
    "Gyros": Setting(EXACT),
    "Gyros, friction 20 % low": Setting(EXACT, friction=0.8),
    "Gyros, friction 20 % high": Setting(EXACT, friction=1.2),
    "Gyros and lateral accelerometers, whose offset is unknown": Setting(EXACT, accelerometers=0.0),
    "The same, with an offset of 0.3 m/s²": Setting(EXACT, accelerometers=0.3),
    "The same, with an offset of 0.3 m/s² that the filters take as 0": Setting(
        replace(EXACT, acceleration_offset=0.0), accelerometers=0.3
    ),
    "Gyros, default settings: unknown bank and offset of the steering": Setting(ObserverSettings()),
    "Gyros, default settings, from the middle of the manoeuvre": Setting(ObserverSettings(), start=2.5),
}


def double_lane_change(acceleration: float) -> Course:
    """To the left and back, with an amplitude of the lateral acceleration, m/s^2."""
    offset = acceleration / (2 * np.pi * FREQUENCY**2)
    change = LaneChange(offset=offset, length=STANDARD_SPEED / FREQUENCY, rest=0.5, min_period=1.0)
    return change.path(count=2, speed=STANDARD_SPEED)


@cache
def driven(manoeuvre: str, friction: float, acceleration: float) -> PlantRun:
    """A run of the nonlinear truck."""
    sine = manoeuvre == "sine"
    course = single_sine(TRUCK, acceleration=acceleration) if sine else double_lane_change(acceleration)
    return Plant(TRUCK, Properties(friction=friction)).drive(course)


def logged(run: PlantRun, setting: Setting, seed: int) -> Record:
    """The log of a run, with the true sideslip angles as reference."""
    sensors = {name: sensor for name, sensor in article_sensors(TRUCK).items() if name in SIGNALS}
    if setting.accelerometers is not None:
        offsets = setting.accelerometers, -setting.accelerometers
        sensors |= {n: Sensor(bias=x, variance=NOISE[n]) for n, x in zip(ACCELEROMETERS, offsets, strict=True)}
    used = run.time >= setting.start
    signals = {name: values[used] for name, values in measure(run.time, run.truth, sensors, seed=seed).items()}
    reference = {f"sideslip.{unit}": run.truth[f"sideslip.{unit}"][used] for unit in UNITS}
    return Record(time=run.time[used], signals=signals, reference=reference, name=run.name)


def observer_model(vehicle: Vehicle, signals: Iterable[str], settings: ObserverSettings, kind: Filter) -> ObserverModel:
    """The models and numbers of an observer with one of the filters."""
    base = Observer(vehicle, signals, settings)._model
    if kind in ("linear", "extended"):
        return base
    return UnscentedModel(**base.__getstate__(), form=kind)


def with_friction(settings: ObserverSettings, kind: Filter, friction: float) -> ObserverSettings:
    """The settings of a filter on a road."""
    return settings if kind == "linear" else replace(settings, friction=friction)


def cell(run: PlantRun, setting: Setting, kind: Filter) -> str:
    """Errors, coverage and NIS of a filter."""
    squares, within, nis = [], [], []
    for seed in range(SEEDS):
        record = logged(run, setting, seed)
        settings = with_friction(setting.settings, kind, PEAK * run.properties.friction * setting.friction)
        model = observer_model(TRUCK, record.signals, replace(settings, noise=NOISE), kind)
        states = offline.states(record, model, None, smooth=False)
        errors = {name: states.values[name] - truth for name, truth in record.reference.items()}
        squares.append([np.mean(error**2) for error in errors.values()])
        within.append([np.abs(error) < NINETY_PERCENT * states.sigma[name] for name, error in errors.items()])
        nis.append(states.nis)
    rms = np.degrees(np.sqrt(np.mean(squares, axis=0)))
    return f"{rms[0]:.2f}, {rms[1]:.2f}; {100 * np.mean(within):.0f}; {np.mean(nis):.1f}"


def accuracy(title: str, setting: Setting) -> list[str]:
    """A table of all cases."""
    rows = []
    for manoeuvre in ("sine", "double lane change"):
        for friction, acceleration in CASES:
            name = f"{manoeuvre}, {PEAK * friction:.2g}, {acceleration:g}"
            try:
                run = driven(manoeuvre, friction, acceleration)
            except FifthwheelError as error:
                rows.append([name, str(error), *[""] * (1 + len(FILTERS))])
                continue
            largest = max(np.abs(run.truth["speed"] * run.truth[f"yaw_rate.{u}"]).max() for u in UNITS) / 9.81
            truth = ", ".join(f"{np.degrees(np.abs(run.truth[f'sideslip.{u}']).max()):.1f}" for u in UNITS)
            rows.append([name, f"{largest:.2f}", truth, *[cell(run, setting, kind) for kind in FILTERS]])
    heads = ("manoeuvre, friction, m/s²", "largest u r / g", "largest sideslip, deg", *FILTERS.values())
    return [f"## {title}", "", *table(heads, rows), ""]


class Samples(NamedTuple):
    """Arguments of a compiled step."""

    carry: Array
    rows: Array
    constant: Array

    @classmethod
    def of(cls, model: ObserverModel, record: Record) -> "Samples":
        _, (segment, *_) = stream_segments(record, model.stream, model.step_limit)
        carry = np.append(model.start(segment.first), monitor.START)
        return cls(carry, segment.rows[:], model.constant())


def step_times() -> list[str]:
    """Duration of a step, as a ratio to that of the linear filter; the best of several runs in turn."""
    record = logged(driven("sine", 1.0, 3.0), SETTINGS["Gyros"], 0)
    without = TRUCK.replace({f"{path}.relaxation_length": 0.0 for path in TRUCK.axle_loads()})
    rows = []
    for title, vehicle in (("8 states and an offset", without), ("11 states and an offset", TRUCK)):
        kinds: tuple[Filter, ...] = ("linear", *NONLINEAR)
        models = [observer_model(vehicle, record.signals, with_friction(EXACT, kind, PEAK), kind) for kind in kinds]
        runs = [(model.scan, Samples.of(model, record)) for model in models]
        times = np.full((100, len(runs)), np.inf)
        for durations in times:
            for i, (scan, samples) in enumerate(runs):
                begin = time.perf_counter()
                scan(*samples)
                durations[i] = time.perf_counter() - begin
        rows.append([title, *(f"{ratio:.1f}" for ratio in times.min(axis=0) / times[:, 0].min())])
    heads = ("model", "linear", *NONLINEAR.values())
    return ["## Duration of a step", "", *table(heads, rows), ""]


HEADER = """
#include <math.h>
#define FW_REAL(x) ((fw_real)(x))
#define FW_SQRT(x) FW_REAL(sqrt(x))
#define FW_EXP(x) FW_REAL(exp(x))
#define FW_LOG(x) FW_REAL(log(x))
#define FW_ABS(x) FW_REAL(fabs(x))
#define FW_SIN(x) FW_REAL(sin(x))
#define FW_COS(x) FW_REAL(cos(x))
#define FW_ATAN(x) FW_REAL(atan(x))
"""


def in_single_precision(model: ObserverModel, samples: Samples) -> tuple[Array, Array]:
    """Carries and outputs (N, n) of a step with 32-bit numbers."""
    names = ("carry", "sample", "constant")
    text = function(model.scan.step.expand(), "step", names, ("carry_out", "output"), static=False)
    with tempfile.TemporaryDirectory() as folder:
        source, library = Path(folder) / "step.c", Path(folder) / "step.so"
        source.write_text("typedef float fw_real;" + HEADER + text)
        subprocess.run(["cc", "-O1", "-shared", "-fPIC", "-o", library, source, "-lm"], check=True)
        step = ctypes.CDLL(str(library)).step
    carry, rows, constant = (array.astype(np.float32) for array in samples)
    carries = np.zeros((len(rows), len(carry)), dtype=np.float32)
    outputs = np.zeros((len(rows), model.scan.n_output), dtype=np.float32)
    for k, row in enumerate(rows):
        arrays = (carry, np.ascontiguousarray(row), constant, carry, outputs[k])
        step(*[ctypes.c_void_p(array.ctypes.data) for array in arrays])
        carries[k] = carry
    return carries.astype(float), outputs.astype(float)


def covariances(carries: Array, model: ObserverModel) -> Array:
    """P (N, n, n) in carries (N, n_carry) of a filter."""
    n = len(model.model.states)
    stored = unpack_array(carries[:, n : n + packed_size(n)], n)
    if isinstance(model, UnscentedModel) and model.form == "square root":
        stored = np.tril(stored)
        return np.asarray(stored @ stored.swapaxes(1, 2))
    return stored


def correlations(P: Array) -> Array:
    """Correlation matrices of covariances (N, n, n)."""
    scale = np.sqrt(np.einsum("kii->ki", P))
    return np.asarray(P / (scale[:, :, None] * scale[:, None, :]))


def conditioning() -> list[str]:
    """Condition number of P, and the effect of single precision on the reported sideslip."""
    rows = []
    for manoeuvre, friction, acceleration in (("sine", 1.0, 4.0), ("double lane change", 0.35, 2.0)):
        record = logged(driven(manoeuvre, friction, acceleration), SETTINGS["Gyros"], 0)
        for kind in NONLINEAR:
            settings = with_friction(ObserverSettings(), kind, PEAK * friction)
            model = observer_model(TRUCK, record.signals, settings, kind)
            samples = Samples.of(model, record)
            step, names = model.scan, model.report.outputs
            double = [step(samples.carry, samples.rows[:k], samples.constant)[0] for k in range(50, 1000, 50)]
            P, (_, exact) = covariances(np.array(double), model), step(*samples)
            carries, single = in_single_precision(model, samples)
            sideslip = [names.index(f"sideslip.{unit}") for unit in UNITS]
            change = np.abs(single - exact)[:, sideslip].max(axis=0)
            sigma = exact[:, len(names) :][:, sideslip].min(axis=0)
            rows.append(
                [
                    f"{manoeuvre}, {PEAK * friction:.2g}, {acceleration:g}",
                    NONLINEAR[kind],
                    f"{np.linalg.cond(P).max():.0e}",
                    f"{np.linalg.cond(correlations(P)).max():.0e}",
                    f"{np.linalg.eigvalsh(correlations(covariances(carries, model))).min():.0e}",
                    ", ".join(f"{x:.0e}" for x in np.degrees(change)),
                    ", ".join(f"{x:.2f}" for x in np.degrees(sigma)),
                ]
            )
    heads = (
        "manoeuvre, friction, m/s²",
        "filter",
        "largest condition number of P",
        "of its correlation matrix",
        "32 bits: least eigenvalue of the correlation matrix",
        "32 bits: largest change of the sideslip, deg",
        "least sigma of the sideslip, deg",
    )
    return ["## Conditioning", "", *table(heads, rows), ""]


def main() -> None:
    """Write the tables."""
    lines = ["# Nonlinear Kalman filters", ""]
    lines += ["Written by `python benchmarks/filters.py`; its docstring explains the tables.", ""]
    lines += step_times() + conditioning()
    for title, setting in SETTINGS.items():
        lines += accuracy(title, setting)
        print(title, flush=True)
    Path(__file__).with_suffix(".md").write_text("\n".join(lines))


if __name__ == "__main__":
    main()
