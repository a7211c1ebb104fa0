"""The files of an identification: identification.json and vehicle.toml, and the time series in series.npz."""

import json
import math
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from pydantic import TypeAdapter, ValidationError

from fifthwheel._atomic import atomic_write
from fifthwheel._types import Array
from fifthwheel.checks import Finding
from fifthwheel.errors import FifthwheelError, SignalError, printable
from fifthwheel.identify.doubts import Doubt
from fifthwheel.identify.knowledge.knowledge import Knowledge
from fifthwheel.identify.knowledge.storage import KNOWLEDGE
from fifthwheel.identify.result.parts import (
    Estimate,
    Fit,
    IdentificationData,
    LogSummary,
    ParameterHistory,
    SensorError,
)
from fifthwheel.identify.settings import imported, method_named, require_own_functions
from fifthwheel.input_files import read_json, require_regular
from fifthwheel.observe.uncertainty import Uncertainty
from fifthwheel.vehicle import Vehicle

T = TypeVar("T")

CONTENTS, SERIES = "identification.json", "series.npz"
FIT, HISTORY = ("time", "measured", "predicted", "whitened"), ("time", "values", "sigma")
"""Time series of each fit and of each history."""
PARTS = {"parameters": Estimate, "derived": Estimate, "uncertain": Estimate, "sensors": SensorError}
PARTS |= {"doubts": Doubt, "logs": LogSummary, "findings": Finding}
"""Fields that are tuples of dataclasses."""
NUMBERS = ("surroundings", "variance_budget", "remaining_uncertainty")
"""Fields with numbers by name."""
MAX_SERIES = 1_000_000_000
"""Bytes of all time series together."""


def save(identification: IdentificationData, folder: Path) -> None:
    """Write the files of an identification to a folder; see `Identification.save`."""
    folder.mkdir(parents=True, exist_ok=True)
    names = (CONTENTS, "vehicle.toml", KNOWLEDGE, SERIES)
    if (foreign := [name for name in names if (folder / name).exists()]) and not is_result(folder):
        raise FifthwheelError(f"{folder / foreign[0]}: not of an earlier result; choose another folder, or move it")
    with atomic_write(folder / CONTENTS) as temporary:
        temporary.write_text(as_json(contents_of(identification)) + "\n", encoding="utf-8")
    identification.vehicle.save(folder / "vehicle.toml")
    with atomic_write(folder / SERIES) as temporary, temporary.open("wb") as file:
        series: Any = series_of(identification)  # the stub of savez_compressed takes only arrays and a flag
        np.savez_compressed(file, **series)
    if identification.knowledge is not None:
        identification.knowledge.save(folder / KNOWLEDGE)


def load(path: Path, make: Callable[..., T]) -> T:
    """What `make` makes of the fields in a folder, or of an identification.json; see `Identification.load`."""
    path = path / CONTENTS if path.is_dir() else path
    contents = read_contents(path)
    series = read_series(path.with_name(SERIES))
    require_own_functions(contents, str(path))
    try:
        known = path.with_name(KNOWLEDGE)
        knowledge = Knowledge.load(known) if known.exists() else None
        return make(**fields_of(contents, series), knowledge=knowledge)
    except SignalError as error:
        raise SignalError(f"{path}: {error}") from None
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        reason = printable(str(error).partition("\n")[0])
        raise SignalError(
            f"{path}: not an identification.json of this version ({reason}); give the file that "
            "`fifthwheel identify` wrote, or identify again"
        ) from None


def contents_of(identification: IdentificationData) -> dict[str, Any]:
    """The contents of identification.json."""
    return {
        "version": identification.version,
        "method": identification.method,
        "preset": identification.settings.preset,
        "vehicle": identification.initial_vehicle.name,
        "vehicle_file": identification.vehicle.model_dump(mode="json"),
        "initial_vehicle_file": identification.initial_vehicle.model_dump(mode="json"),
        "signals": list(identification.signals),
        **{key: [asdict(part) for part in getattr(identification, key)] for key in PARTS},
        **{key: dict(getattr(identification, key)) for key in NUMBERS},
        "uncertainty": None if identification.covariance is None else identification.covariance.as_dict(),
        "fit": [
            {name: getattr(fit, name) for name in ("log", "signal", "explained", "rms", "identified_on")}
            for fit in identification.fits
        ],
        "histories": {title: {"names": h.names, "starts": h.starts} for title, h in identification.histories.items()},
        "log_likelihood": identification.log_likelihood,
        "rounds": identification.rounds,
        "notes": list(identification.notes),
        "settings": identification.settings.as_dict(),
    }


def series_of(identification: IdentificationData) -> dict[str, Array]:
    """Time series of fits and histories by name."""
    fits = {f"fit/{k}/{part}": getattr(fit, part) for k, fit in enumerate(identification.fits) for part in FIT}
    return fits | {
        f"history/{title}/{part}": getattr(history, part)
        for title, history in identification.histories.items()
        for part in HISTORY
    }


def fields_of(contents: Mapping[str, Any], series: Mapping[str, Array]) -> dict[str, Any]:
    """The fields of an `Identification`: the inverse of `contents_of` and `series_of`."""
    uncertainty = contents["uncertainty"]
    covariance = None if uncertainty is None else Uncertainty.from_dict(uncertainty)
    return dict(
        **{key: parts(kind, contents[key]) for key, kind in PARTS.items()},
        **{key: dict(contents[key]) for key in NUMBERS},
        method=str(contents["method"]),
        vehicle=Vehicle(**contents["vehicle_file"]),
        initial_vehicle=Vehicle(**contents["initial_vehicle_file"]),
        signals=tuple(map(str, contents["signals"])),
        covariance=covariance,
        histories={
            title: ParameterHistory(
                names=tuple(history["names"]),
                starts=tuple(history["starts"]),
                **{part: series[f"history/{title}/{part}"] for part in HISTORY},
            )
            for title, history in contents["histories"].items()
            if f"history/{title}/time" in series
        },
        fits=parts(
            Fit,
            [
                fit | {part: series.get(f"fit/{k}/{part}", np.zeros(0)) for part in FIT}
                for k, fit in enumerate(contents["fit"])
            ],
        ),
        settings=parts(imported(method_named(contents["method"]).settings), [contents["settings"]])[0],
        log_likelihood=contents["log_likelihood"],
        rounds=int(contents["rounds"]),
        notes=tuple(map(str, contents["notes"])),
        version=str(contents["version"]),
    )


def as_json(contents: Mapping[str, Any]) -> str:
    """Contents as JSON; a number that is not finite becomes null."""
    return json.dumps(_finite(contents), indent=2)


def parts(kind: type[T], rows: Sequence[Mapping[str, Any]]) -> tuple[T, ...]:
    """Dataclasses from their fields in a file; a SignalError names a field that has another type."""
    adapter: TypeAdapter[T] = TypeAdapter(kind)
    made = []
    for row in rows:
        try:
            made.append(adapter.validate_python(row))
        except ValidationError as error:
            first = error.errors()[0]
            inner = [str(step) for step in first["loc"][1:]]
            name = ".".join(inner) or row.get("name") or str(first["loc"][0])
            raise SignalError(f"{name}: expected another value: {first['msg']}, got {first['input']!r}") from None
    return tuple(made)


def read_contents(path: Path) -> dict[str, Any]:
    """The contents of an identification.json; a SignalError for another file."""
    try:
        contents = read_json(path)
    except FifthwheelError as error:
        raise SignalError(f"{error}; give the {CONTENTS} that `fifthwheel identify` wrote") from None
    if not isinstance(contents, dict):
        raise SignalError(f"{path}: not an {CONTENTS}; give the file that `fifthwheel identify` wrote")
    return contents


def is_result(folder: Path) -> bool:
    """Whether a folder has an identification.json that `save` or `fifthwheel identify` wrote."""
    try:
        return {"method", "parameters", "version"} <= read_contents(folder / CONTENTS).keys()
    except (OSError, SignalError):
        return False


def read_series(path: Path) -> dict[str, Array]:
    """The time series by name, none if there is no such file; a SignalError if it is damaged or too large."""
    if not path.exists():
        return {}
    require_regular(path)
    try:
        with zipfile.ZipFile(path) as archive:
            if sum(info.file_size for info in archive.infolist()) > MAX_SERIES:
                raise SignalError(f"{path}: larger than {MAX_SERIES / 1e6:g} MB; identify again, or delete it")
        with np.load(path, allow_pickle=False) as arrays:
            return {name: np.asarray(arrays[name], dtype=np.float64) for name in arrays.files}
    except (OSError, ValueError, zipfile.BadZipFile, MemoryError, EOFError) as error:
        if isinstance(error, SignalError):
            raise
        raise SignalError(f"{path}: damaged ({error}); identify again, or delete it") from None


def _finite(value: Any) -> Any:
    """Nested data with None for every number that is not finite."""
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
