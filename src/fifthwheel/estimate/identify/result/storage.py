"""The files of an identification: identification.json and vehicle.toml, and the time series in series.npz."""

import json
import math
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

import numpy as np

from fifthwheel.base.atomic import atomic_write
from fifthwheel.base.errors import FifthwheelError, SignalError, printable
from fifthwheel.base.input_files import read_json, require_regular
from fifthwheel.base.settings import Settings
from fifthwheel.base.types import Array
from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge
from fifthwheel.estimate.identify.knowledge.storage import IDENTIFICATION, KNOWLEDGE
from fifthwheel.estimate.identify.result.parts import IdentificationData
from fifthwheel.estimate.identify.settings import require_own_functions, settings_of_method
from fifthwheel.estimate.identify.stored import ValidationError, restored
from fifthwheel.estimate.observe.uncertainty import Uncertainty
from fifthwheel.truck import Vehicle

T = TypeVar("T")

SERIES = "series.npz"
OTHER = "knowledge"
"""The field with a file of its own."""
KEYS = {
    "vehicle": "vehicle_file",
    "initial_vehicle": "initial_vehicle_file",
    "covariance": "uncertainty",
    "fits": "fit",
}
"""Of fields whose key in the file is not their name."""
MAX_SERIES = 1_000_000_000
"""Bytes of all time series together."""


def save(identification: IdentificationData, folder: Path) -> None:
    """Write the files of an identification to a folder; see `Identification.save`."""
    folder.mkdir(parents=True, exist_ok=True)
    names = (IDENTIFICATION, "vehicle.toml", KNOWLEDGE, SERIES)
    if (foreign := [name for name in names if (folder / name).exists()]) and not is_result(folder):
        raise FifthwheelError(f"{folder / foreign[0]}: not of an earlier result; choose another folder, or move it")
    with atomic_write(folder / IDENTIFICATION) as temporary:
        temporary.write_text(as_json(contents_of(identification)) + "\n", encoding="utf-8")
    identification.vehicle.save(folder / "vehicle.toml")
    with atomic_write(folder / SERIES) as temporary, temporary.open("wb") as file:
        series: Any = series_of(identification)  # the stub of savez_compressed takes only arrays and a flag
        np.savez_compressed(file, **series)
    if identification.knowledge is not None:
        identification.knowledge.save(folder / KNOWLEDGE)


def load(path: Path, make: Callable[..., T]) -> T:
    """What `make` makes of the fields in a folder, or of an identification.json; see `Identification.load`."""
    path = path / IDENTIFICATION if path.is_dir() else path
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
    values = {key: _plain(getattr(identification, name)) for name, key in _keys().items()}
    return {"preset": identification.settings.preset, "vehicle": identification.initial_vehicle.name, **values}


def _keys() -> dict[str, str]:
    """The key of each field in the file."""
    return {field.name: KEYS.get(field.name, field.name) for field in fields(IdentificationData) if field.name != OTHER}


def _plain(value: Any) -> Any:
    """Nested data without arrays."""
    if isinstance(value, Vehicle):
        return value.model_dump(mode="json")
    if isinstance(value, Settings | Uncertainty):
        return value.as_dict()
    if is_dataclass(value):
        return {f.name: _plain(v) for f in fields(value) if not isinstance(v := getattr(value, f.name), np.ndarray)}
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, tuple) else value


def series_of(identification: IdentificationData) -> dict[str, Array]:
    """Time series of fits and histories by name."""
    fits, histories = enumerate(identification.fits), identification.histories.items()
    owners: dict[str, Any] = {f"fit/{k}": fit for k, fit in fits} | {f"history/{title}": h for title, h in histories}
    named = {f"{place}/{field.name}": getattr(o, field.name) for place, o in owners.items() for field in fields(o)}
    return {name: value for name, value in named.items() if isinstance(value, np.ndarray)}


def fields_of(contents: Mapping[str, Any], series: Mapping[str, Array]) -> dict[str, Any]:
    """The fields of an `Identification`: the inverse of `contents_of` and `series_of`."""
    found = {name: contents[key] for name, key in _keys().items()}
    arrays: dict[str, dict[str, Array]] = {}
    for name, values in series.items():
        place, _, part = name.rpartition("/")
        arrays.setdefault(place, {})[part] = values
    found["fits"] = [fit | arrays.get(f"fit/{k}", {}) for k, fit in enumerate(contents["fit"])]
    places = {title: f"history/{title}" for title in contents["histories"]}
    found["histories"] = {t: contents["histories"][t] | arrays[p] for t, p in places.items() if p in arrays}
    kinds = get_type_hints(IdentificationData, include_extras=True)
    kinds["settings"] = settings_of_method(contents["method"])
    return {name: _restored(name, kinds[name], value) for name, value in found.items()}


def as_json(contents: Mapping[str, Any]) -> str:
    """Contents as JSON; a number that is not finite becomes null."""
    return json.dumps(_finite(contents), indent=2)


def _restored(field: str, kind: Any, content: Any) -> Any:
    """A field from its content in a file; a SignalError names a part that has another type."""
    try:
        return restored(kind, content)
    except ValidationError as error:
        first = error.errors()[0]
        if isinstance(cause := first.get("ctx", {}).get("error"), FifthwheelError):
            raise cause from None
        row, steps = content, first["loc"]
        if isinstance(content, list) and steps:
            row, steps = content[int(steps[0])], steps[1:]
        own = row.get("name") if isinstance(row, dict) else ""
        name = ".".join(map(str, steps[1:])) or own or "".join(map(str, steps)) or field
        raise SignalError(f"{name}: expected another value: {first['msg']}, got {first['input']!r}") from None


def read_contents(path: Path) -> dict[str, Any]:
    """The contents of an identification.json; a SignalError for another file."""
    try:
        contents = read_json(path)
    except FifthwheelError as error:
        raise SignalError(f"{error}; give the {IDENTIFICATION} that `fifthwheel identify` wrote") from None
    if not isinstance(contents, dict):
        raise SignalError(f"{path}: not an {IDENTIFICATION}; give the file that `fifthwheel identify` wrote")
    return contents


def is_result(folder: Path) -> bool:
    """Whether a folder has an identification.json that `save` or `fifthwheel identify` wrote."""
    try:
        return {"method", "parameters", "version"} <= read_contents(folder / IDENTIFICATION).keys()
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
