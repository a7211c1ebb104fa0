"""The folder of a C library, and the generated part of an observer: its step, matrices, names and constants."""

from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path

import casadi as ca

from fifthwheel import __version__
from fifthwheel.base.arguments import expect
from fifthwheel.base.atomic import write_text
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.native import c_code
from fifthwheel.estimate.observe import Observer
from fifthwheel.estimate.observe.observer_model import SUSPECT_STEER_SIGMA
from fifthwheel.estimate.online import Learner
from fifthwheel.estimate.stream import StreamSettings
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.chain import equations, state_names
from fifthwheel.results.export import c_text, learner_model
from fifthwheel.results.export.c_text import definitions, stream_definitions, stream_tables, table, with_constant

SHARED = ("fw_samples.h", "fw_math.h", "fw_algebra.h", "fw_stream.h", "fw_step_length.h", "replay_log.h")
OBSERVER_SOURCES = ("fw_observer.c",)
LEARNER_SOURCES = (
    "fw_learner.c",
    "fw_excitation.c",
    "fw_learner_model.c",
    "fw_joint.c",
    "fw_start.c",
    "fw_segment.c",
    "fw_estimates.c",
    "fw_storage.c",
)
FILES = ("README.md", "CMakeLists.txt", "fw_observer.h", *OBSERVER_SOURCES, "fw_model.h", *SHARED, "replay.c")
"""The files of an exported observer."""
LEARNER_FILES = (
    "README.md",
    "CMakeLists.txt",
    "fw_learner.h",
    *LEARNER_SOURCES,
    "fw_learner_model.h",
    "fw_private.h",
    *SHARED,
    "replay.c",
)
"""The files of an exported learner."""


def observer_header(observer: Observer) -> str:
    """Names and sizes for the public header."""
    sizes = {
        "MODEL_INPUT_COUNT": (len(observer.model.inputs), "inputs of the model"),
        "CARRY_COUNT": (observer.scan.n_carry, "numbers in the state of the filter"),
    }
    return c_text.header(observer.stream.settings, observer.reported, sizes)


def observer_source(observer: Observer) -> str:
    """The step of the filter, the matrices of the vehicle and all constants, for the private header."""
    settings, vehicle, stream, roll = observer.settings, observer.vehicle, observer.stream.settings, observer.roll
    critical = dynamics.critical_speed(vehicle, roll=roll)
    errors, offsets = settings.sensor_errors, observer.model.offsets
    sizes = {
        "FILTER_STATES": len(observer.model.states),
        "STEER_COUNT": len(vehicle.steer_signals()),
        "UNKNOWN_COUNT": 1 + len(offsets),
        "ESTIMATES_BANK": int(settings.estimate_bank),
    }
    numbers = {
        "MAX_NIS": settings.max_nis,
        "SUSPECT_STEER_SIGMA": SUSPECT_STEER_SIGMA,
        "CRITICAL_SPEED": 1e6 if critical is None else critical,
    }
    step = with_constant(observer.function, ca.DM(observer.constant))
    return "\n".join(
        [
            *definitions(sizes, numbers),
            *stream_definitions(stream, vehicle, roll=roll),
            "",
            *stream_tables(stream, vehicle, roll=roll, static=True),
            table("unknown_mean", [settings.bank_mean, *(errors.get(name, 0.0) for name in offsets)]),
            table("unknown_sigma", [settings.bank, *map(settings.offset_sigma, offsets)]),
            "",
            c_code.function(_matrices(observer), "fw_matrices", ("inputs",), ("a", "b", "bank", "steer", "slope")),
            c_code.function(step, "fw_step", ("carry", "sample"), ("next", "out")),
        ]
    )


def _matrices(observer: Observer) -> ca.Function:
    """Speed and measured steer angles -> with the numbers of the vehicle A (n, n) and B (n, k) by rows, the effect (n,)
    of the bank, the angles (k,) of the wheels and their derivatives (k,) with respect to the measured ones."""
    vehicle, roll = observer.vehicle, observer.roll
    steers, n = vehicle.steer_signals(), len(state_names(vehicle, roll=roll))
    inputs = ca.SX.sym("inputs", 1 + len(steers))
    angles = dynamics.true_angles(steers, inputs[1:], observer.settings.sensor_errors)
    slopes = ca.diag(ca.jacobian(angles, inputs[1:]))
    values = {name: ca.SX(value) for name, value in vehicle.parameters().items()}
    A, B = equations(values, vehicle, roll=roll, bank=True).state_space(inputs[0])
    results = [c_code.by_rows(A[:n, :n]), c_code.by_rows(B[:n, :]), c_code.by_rows(A[:n, n]), angles, slopes]
    return c_code.step("matrices", [inputs], results)


def export_c(estimator: Observer | Learner, folder: str | Path) -> list[Path]:
    """Write an observer or a learner as a library in C99, with its build file and a test program.

    Args:
        estimator: with vehicle, signals and settings; its present state and estimates are not exported.
        folder: for `FILES` or `LEARNER_FILES`; made if it does not exist.

    Returns:
        The files.

    Raises:
        FifthwheelError: two signals have the same name in C.

    Example:
        >>> import tempfile
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> observer = fw.Observer(truck, ["speed", "steer.tractor.front", "yaw_rate.tractor", "yaw_rate.semitrailer"])
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     [path.name for path in fw.export_c(observer, folder)][:5]
        ['README.md', 'CMakeLists.txt', 'fw_observer.h', 'fw_observer.c', 'fw_model.h']
    """
    expect("estimator", estimator, Observer, Learner)
    folder = Path(folder)
    if folder.exists() and not folder.is_dir():
        raise FifthwheelError(f"{folder}: a file; name a folder, which is made if it does not exist")
    folder.mkdir(parents=True, exist_ok=True)
    texts = learner_texts(estimator) if isinstance(estimator, Learner) else observer_texts(estimator)
    for name, text in texts.items():
        write_text(folder / name, text)
    return [folder / name for name in texts]


def observer_texts(observer: Observer) -> dict[str, str]:
    """The content of each of `FILES`."""
    derived = len(observer.model.inputs) - len(observer.inputs)
    numbers = 2 + 3 * len(observer.inputs) + 4 * derived + observer.scan.n_carry
    marks = _common(observer.vehicle.name, observer.stream.settings, OBSERVER_SOURCES, observer.reported) | {
        "BYTES": str(8 * numbers + 8),
        "ENUMERATIONS": observer_header(observer),
        "MODEL": observer_source(observer),
    }
    return {name: source(name, marks) for name in FILES}


def learner_texts(learner: Learner) -> dict[str, str]:
    """The content of each of `LEARNER_FILES`."""
    live, common = learner.live, ("CMakeLists.txt", *SHARED)
    marks = _common(live.setup.vehicle.name, live.stream.settings, LEARNER_SOURCES, live.view.names)
    marks |= learner_model.texts_of(learner)
    return {name: source(name if name in common else f"learner/{name}", marks) for name in LEARNER_FILES}


def _common(vehicle: str, stream: StreamSettings, sources: Sequence[str], states: Sequence[str]) -> dict[str, str]:
    """Marks of every library, which has the name of its first source."""
    return {
        "TITLE": "".join(c for c in vehicle if c.isalnum() or c in " -_.,()"),
        "VERSION": __version__,
        "COLUMNS": ", ".join([*(rule.name for rule in stream.inputs), *stream.measured]),
        "STATES": ",".join([*states, *(f"{name}.sigma" for name in states)]),
        "LIBRARY": sources[0].removesuffix(".c"),
        "SOURCES": " ".join(sources),
    }


def source(name: str, marks: Mapping[str, str] | None = None) -> str:
    """Content of a file of `results/export/c`, in which marks such as @TITLE@ are replaced."""
    folder = resources.files("fifthwheel.results.export") / "c"
    given = folder / name
    text = (given if given.is_file() else folder / f"{name}.in").read_text(encoding="utf-8")
    for key, value in (marks or {}).items():
        text = text.replace(f"@{key}@", value)
    return text
