"""The files of an identification: identification.json and vehicle.toml, and the time series in series.npz."""

import json
import math
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from pydantic import TypeAdapter, ValidationError

from fifthwheel._atomic import atomic_write
from fifthwheel._types import Array
from fifthwheel.errors import FifthwheelError, SignalError
from fifthwheel.input_files import read_json, require_regular

T = TypeVar("T")

CONTENTS, SERIES = "identification.json", "series.npz"
MAX_SERIES = 1_000_000_000
"""Bytes of all time series together."""


def as_json(contents: Mapping[str, Any]) -> str:
    """Contents as JSON; a number that is not finite becomes null."""
    return json.dumps(_finite(contents), indent=2)


def parts(kind: type[T], rows: Sequence[Mapping[str, Any]]) -> tuple[T, ...]:
    """Dataclasses from their fields in a file.

    Raises:
        SignalError: a field has another type; the message names it.
    """
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


def write_series(path: Path, series: Mapping[str, Array]) -> None:
    """Write time series by name."""
    with atomic_write(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **series)  # type: ignore[arg-type]  # its stub takes only arrays and a flag


def read_contents(path: Path) -> dict[str, Any]:
    """The contents of an identification.json; a SignalError for another file."""
    try:
        contents = read_json(path)
    except FifthwheelError as error:
        raise SignalError(f"{error}; give the {CONTENTS} that `fifthwheel identify` wrote") from None
    if not isinstance(contents, dict):
        raise SignalError(f"{path}: not an {CONTENTS}; give the file that `fifthwheel identify` wrote")
    return contents


def read_series(path: Path) -> dict[str, Array]:
    """The time series by name; none if there is no such file.

    Raises:
        SignalError: the file is damaged or too large.
    """
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
