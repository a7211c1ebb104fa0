"""The folder of a C library."""

from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path

from fifthwheel import __version__
from fifthwheel.base.arguments import expect
from fifthwheel.base.atomic import write_text
from fifthwheel.estimate.observe import Observer
from fifthwheel.estimate.online import Learner
from fifthwheel.estimate.stream import StreamSettings
from fifthwheel.results.export import learner_model, observer_model

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
    folder.mkdir(parents=True, exist_ok=True)
    texts = learner_texts(estimator) if isinstance(estimator, Learner) else observer_texts(estimator)
    for name, text in texts.items():
        write_text(folder / name, text)
    return [folder / name for name in texts]


def observer_texts(observer: Observer) -> dict[str, str]:
    """The content of each of `FILES`."""
    derived = len(observer.model.inputs) - len(observer.inputs)
    numbers = 2 + 3 * len(observer.inputs) + 4 * derived + observer.scan.n_carry
    marks = _common(observer.vehicle.name, observer.stream.settings, OBSERVER_SOURCES) | {
        "BYTES": str(8 * numbers + 8),
        "ENUMERATIONS": observer_model.header(observer),
        "MODEL": observer_model.source(observer),
    }
    return {name: source(name, marks) for name in FILES}


def learner_texts(learner: Learner) -> dict[str, str]:
    """The content of each of `LEARNER_FILES`."""
    live, common = learner.live, ("CMakeLists.txt", *SHARED)
    marks = _common(live.setup.vehicle.name, live.stream.settings, LEARNER_SOURCES)
    marks |= learner_model.texts_of(learner)
    return {name: source(name if name in common else f"learner/{name}", marks) for name in LEARNER_FILES}


def _common(vehicle: str, stream: StreamSettings, sources: Sequence[str]) -> dict[str, str]:
    """Marks of every library, which has the name of its first source."""
    return {
        "TITLE": "".join(c for c in vehicle if c.isalnum() or c in " -_.,()"),
        "VERSION": __version__,
        "COLUMNS": ", ".join([*(rule.name for rule in stream.inputs), *stream.measured]),
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
