"""The generated part of an observer in C: names and sizes for its header, step and constants for its source."""

from collections.abc import Iterable

import casadi as ca
import numpy as np

from fifthwheel import dynamics
from fifthwheel.dynamics import SPEED_RATE
from fifthwheel.dynamics.chain import equations, state_names
from fifthwheel.dynamics.speed_rate import speed_rate_step
from fifthwheel.dynamics.steps import SPEEDS, step_limit
from fifthwheel.export.c_text import enumerations, table, texts
from fifthwheel.filters.initial_state import INITIAL_SIGMA, STEER_BANDWIDTH, TYPICAL_STEER_SIGMA
from fifthwheel.names import SignalName
from fifthwheel.native import c_code
from fifthwheel.observe import Observer
from fifthwheel.observe.observer_model import SUSPECT_STEER_SIGMA
from fifthwheel.record.signal_names import si_unit
from fifthwheel.stream import magnitude


def header(observer: Observer) -> str:
    """Enumerations of the signals and sizes, for the public header."""
    groups = {"INPUT": observer.inputs, "MEASURED": observer.outputs, "STATE": observer.reported}
    lines = enumerations({prefix: {n: str(si_unit(n)) for n in names} for prefix, names in groups.items()})
    sizes = [
        f"#define FW_MODEL_INPUT_COUNT {len(observer.model.inputs)} /* the inputs, and what is derived from them */",
        f"#define FW_CARRY_COUNT {observer.scan.n_carry} /* numbers in the state of the filter */",
    ]
    return "\n".join([*lines, *sizes])


def source(observer: Observer) -> str:
    """The step of the filter, the matrices of the vehicle and all constants, for the private header."""
    settings, vehicle = observer.settings, observer.vehicle
    states = state_names(vehicle, roll=observer.roll)
    floor = [INITIAL_SIGMA[SignalName.of(name).quantity] ** 2 for name in states]
    critical = dynamics.critical_speed(vehicle, roll=observer.roll)
    errors, steered, offsets = settings.sensor_errors, vehicle.steer_signals(), observer.model.offsets
    numbers = {
        "MIN_SPEED": settings.min_speed,
        "MAX_NIS": settings.max_nis,
        "STEER_RATE": 2 * np.pi * STEER_BANDWIDTH,
        "TYPICAL_STEER_SIGMA": TYPICAL_STEER_SIGMA,
        "SUSPECT_STEER_SIGMA": SUSPECT_STEER_SIGMA,
        "CRITICAL_SPEED": 1e6 if critical is None else critical,
    }
    times = {"HOLD": settings.hold, "MAX_GAP": settings.max_gap, "COAST": settings.coast}
    columns = ("time", *observer.inputs, *observer.outputs)
    tables: dict[str, Iterable[float]] = {
        "input_magnitude": [magnitude(name) for name in observer.inputs],
        "input_rate": [rule.rate for rule in observer.stream.settings.inputs],
        "measured_magnitude": [magnitude(name) for name in observer.outputs],
        "steer_gain": [errors.get(f"{name}.gain", 1.0) for name in steered],
        "initial_variance": floor,
        "unknown_mean": [settings.bank_mean, *(errors.get(name, 0.0) for name in offsets)],
        "unknown_sigma": [settings.bank, *map(settings.offset_sigma, offsets)],
        "step_speed": SPEEDS,
        "step_limit": step_limit(vehicle, observer.roll).longest,
    }
    sizes = {
        "FILTER_STATES": len(observer.model.states),
        "MODEL_STATES": len(states),
        "STEER_COUNT": len(steered),
        "UNKNOWN_COUNT": 1 + len(offsets),
        "ESTIMATES_BANK": int(settings.estimate_bank),
        "SPEED_COUNT": len(SPEEDS),
    }
    return "\n".join(
        [
            *(f"#define FW_{name} {size}" for name, size in sizes.items()),
            *(f"#define FW_{name} {c_code.literal(float(value))}" for name, value in numbers.items()),
            *(f"#define FW_{name} {value!r} /* s */" for name, value in times.items()),
            "",
            *(table(name, values) for name, values in tables.items()),
            texts("names", columns),
            texts("units", [str(si_unit(name)) for name in columns]),
            "",
            c_code.function(_matrices(observer), "fw_matrices", ("speed",), ("a", "b", "bank")),
            c_code.function(_step(observer), "fw_step", ("carry", "sample"), ("next", "out")),
            *_speed_rate(observer),
        ]
    )


def _speed_rate(observer: Observer) -> list[str]:
    """The filter of the derivative of the speed, if that is an input of the model."""
    if SPEED_RATE not in observer.model.inputs:
        return []
    constant = ca.DM([1 / observer.settings.speed_smoothing])
    step = _with_constant(speed_rate_step().step, constant)
    return [c_code.function(step, "fw_speed_rate", ("carry", "sample"), ("next", "out"))]


def _matrices(observer: Observer) -> ca.Function:
    """speed -> A (n, n) and B (n, k) by rows, and the effect (n,) of the bank, with the numbers of the vehicle."""
    speed, n = ca.SX.sym("speed"), len(state_names(observer.vehicle, roll=observer.roll))
    values = {name: ca.SX(value) for name, value in observer.vehicle.parameters().items()}
    A, B = equations(values, observer.vehicle, roll=observer.roll, bank=True).state_space(speed)
    parts = A[:n, :n], B[:n, :], A[:n, n]
    return ca.Function("matrices", [speed], [ca.vec(ca.densify(part).T) for part in parts], {"cse": True})


def _step(observer: Observer) -> ca.Function:
    """The step of the observer with its constants as numbers."""
    return _with_constant(observer.scan.step, ca.DM(observer.constant))


def _with_constant(step: ca.Function, constant: ca.DM) -> ca.Function:
    """A step (carry, sample, constant) with its constant as numbers."""
    carry, sample = ca.SX.sym("carry", step.numel_in(0)), ca.SX.sym("sample", step.numel_in(1))
    results = step(carry, sample, constant)
    return ca.Function("step", [carry, sample], list(map(ca.densify, results)), {"cse": True})
