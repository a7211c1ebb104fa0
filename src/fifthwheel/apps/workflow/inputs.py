"""The inputs of a run: the vehicle, and the records of its logs, checked against the vehicle."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from types import MappingProxyType

from fifthwheel.base.atomic import recover
from fifthwheel.base.errors import SignalError, VehicleError, suggestion
from fifthwheel.data.logs import SignalMap, read_log
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge
from fifthwheel.estimate.identify.settings import Progress
from fifthwheel.estimate.online import Learner
from fifthwheel.estimate.online.start import LEARNER_FILE
from fifthwheel.truck import Vehicle, catalogue, toml_format


def identification_file(name: str) -> Path | None:
    """The identification.json that a folder or a file name stands for; None for a vehicle."""
    path = Path(name)
    return path / "identification.json" if path.is_dir() else path if path.suffix == ".json" else None


def vehicle_file(name: str) -> str:
    """The vehicle.toml of a result folder or of the folder of an identification.json; any other name as given."""
    result = identification_file(name)
    return name if result is None else str(result.with_name("vehicle.toml"))


def vehicle_and_identification(vehicle: str, identification: Path | None = None) -> tuple[str, Path | None]:
    """The file, or name in the catalogue, of a vehicle, and the identification.json that belongs to it.

    A result folder stands for both of its files, unless another identification is given. A VehicleError for a folder
    without a vehicle file.
    """
    result = identification_file(vehicle)
    if result is not None:
        recover(result.parent)
        vehicle = str(_file(vehicle))
    if identification is not None:
        result = identification_file(str(identification)) or identification
    elif result is not None and not result.exists():
        result = None
    return vehicle, result


def read_vehicle(name: str) -> Vehicle:
    """The vehicle of this name in the catalogue, of this file, or of this result folder or identification.json.

    A VehicleError if neither exists, or the file does not describe a vehicle.
    """
    if name in catalogue.names():
        return catalogue.get(name)
    return Vehicle.load(_file(name))


def vehicle_text(name: str) -> str:
    """The vehicle file of this name in the catalogue, or of this path; errors as in `read_vehicle`."""
    if name in catalogue.names():
        return catalogue.text(name)
    return toml_format.read(_file(name))


def _file(name: str) -> Path:
    path = Path(vehicle_file(name))
    if not path.is_file() and Path(name).is_dir():
        raise VehicleError(
            f"{name}: a folder without vehicle.toml; give a vehicle file, or the result folder of `fifthwheel identify`"
        )
    if not path.is_file():
        raise VehicleError(
            f"{name}: no such file, and not in the catalogue, which has {', '.join(catalogue.names())}; check the path"
        )
    return path


def read_records(
    paths: Sequence[Path],
    signal_map: SignalMap | None = None,
    *,
    exclude: Mapping[str, Sequence[tuple[float, float]]] = MappingProxyType({}),
    progress: Progress = lambda *_: None,
) -> list[Record]:
    """The record of each log, named by the file's stem, or by the path where two stems are the same.

    Args:
        paths: logs of one vehicle.
        signal_map: which column is which signal, the same for all logs.
        exclude: windows that are left out, as of `read_log`, by the name of a record; "" for all records.

    Raises:
        SignalError: a log that cannot be read, or windows of another one.
    """
    stems = [path.stem for path in paths]
    names = [path.stem if stems.count(path.stem) == 1 else str(path) for path in paths]
    if unknown := sorted(set(exclude) - {"", *names}):
        raise SignalError(
            f"{unknown[0]}: windows are excluded, but there is no such log; {suggestion(unknown[0], names)}"
        )
    return [
        read_log(
            path,
            signal_map,
            name=name,
            exclude=(*exclude.get("", ()), *exclude.get(name, ())),
            progress=partial(report_fraction, progress, f"reading {path.name}"),
        )
        for path, name in zip(paths, names, strict=True)
    ]


def report_fraction(progress: Progress, title: str, fraction: float) -> None:
    """Report a fraction of the work as thousandths."""
    progress(title, round(1000 * fraction), 1000)


def read_knowledge(path: Path) -> Knowledge:
    """The knowledge in a result folder, of its identification.json, of a knowledge.json, or of the file of a learner.

    A SignalError if the file cannot be read, or has no knowledge.
    """
    if not LEARNER_FILE.wrote(path):
        return Knowledge.load(path)
    learned = Learner.load(path).knowledge
    if not learned.logs:
        raise SignalError(f"{path}: the learner has learned nothing since it began; give another result")
    return learned
