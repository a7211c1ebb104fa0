"""Stored results: written, read and compared, on one machine."""

import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from fifthwheel.base.spelling import spelled_for
from tests.frozen.cases import CASES, DATA

FOLDER = Path(__file__).parents[2] / ".frozen"
SHOWN = 6
"""Number of elements that are stored of an array, besides its digest."""
LONG = 24
"""Number of elements from which a list of numbers is stored as an array."""


def available(name: str) -> bool:
    """Whether the logs of a case are present."""
    data = CASES[name].data
    return data is None or (DATA / data).is_dir()


def store(name: str) -> None:
    """Compute and store the results of a case."""
    FOLDER.mkdir(exist_ok=True)
    text = json.dumps(results_of(name), indent=0, ensure_ascii=False)
    (FOLDER / f"{name}.json").write_text(text + "\n", encoding="utf-8")


def results_of(name: str) -> dict[str, Any]:
    """Results of a case as stored, with the options of the command line in its texts.

    With one thread of BLAS, because the order of its sums depends on their number.
    """
    with threadpool_limits(limits=1, user_api="blas"), spelled_for("command line"):
        results: dict[str, Any] = json.loads(json.dumps(dict(flat(CASES[name].run()))))
    return results


def differences(name: str, tolerance: float = 0.0) -> list[str]:
    """The results of a case that differ from the stored ones, a line each.

    Args:
        name: of the case.
        tolerance: relative, of numbers; 0 for equal bits.
    """
    expected = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    results = results_of(name)
    found = [f"{key}: missing" for key in expected if key not in results]
    found += [f"{key}: new" for key in results if key not in expected]
    sizes = largest_of_entries(expected)
    for key, value in results.items():
        entry, _, last = key.rpartition("/")
        smallest = 1e-9 if "sigma" in last else max(1e-9, tolerance * sizes.get(entry, 0.0))
        if key in expected and not same(value, expected[key], tolerance, smallest):
            found.append(f"{key}: {value!r}, expected {expected[key]!r}")
    return found


def largest_of_entries(results: Mapping[str, Any]) -> dict[str, float]:
    """The largest number of each entry, such as an estimate, by its path; not of the whole result."""
    sizes: dict[str, float] = {}
    for key, value in results.items():
        entry = key.rpartition("/")[0]
        if entry.count("/") > 1 and isinstance(value, float) and math.isfinite(value):
            sizes[entry] = max(sizes.get(entry, 0.0), abs(value))
    return sizes


def same(value: Any, expected: Any, tolerance: float, smallest: float = 1e-9) -> bool:
    """Whether two stored values are equal, or with a tolerance close; then digests and texts are not compared.

    Args:
        value: computed now.
        expected: as stored.
        tolerance: relative, of numbers; the elements of an array are compared with the largest of them.
        smallest: difference that is always allowed.
    """
    if not tolerance or type(value) is not type(expected):
        return json.dumps(value) == json.dumps(expected)
    if isinstance(value, list) and len(value) == len(expected):
        sizes = [abs(item) for item in expected if isinstance(item, float) and math.isfinite(item)]
        smallest = max([smallest, *(tolerance * size for size in sizes)])
        return all(same(a, b, tolerance, smallest) for a, b in zip(value, expected, strict=True))
    if isinstance(value, float):
        both_missing = math.isnan(value) and math.isnan(expected)
        return both_missing or math.isclose(value, expected, rel_tol=tolerance, abs_tol=smallest)
    return isinstance(value, str) or bool(value == expected)


def flat(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Nested results as pairs of a path and a number, a text, or what is stored of an array."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from flat(item, f"{path}/{key}")
    elif isinstance(value, np.ndarray | Sequence) and not isinstance(value, str) and (a := as_array(value)) is not None:
        yield path, condensed(a)
    elif isinstance(value, np.ndarray | Sequence) and not isinstance(value, str):
        for i, item in enumerate(value):
            yield from flat(item, f"{path}/{key_of(item) or i}")
    elif isinstance(value, str) and len(value) > 2000:
        yield path, hashlib.sha256(value.encode()).hexdigest()
    elif isinstance(value, Enum):
        yield path, str(value.value)
    else:
        yield path, value.item() if isinstance(value, np.generic) else value


def key_of(item: Any) -> str | None:
    """Name of an item of a list, with its log or signal; None if it has none."""
    if not isinstance(item, Mapping):
        return None
    return "@".join(str(item[key]) for key in ("name", "signal", "log") if item.get(key)) or None


def as_array(values: Any) -> Any:
    """An array of many numbers; None for other data."""
    try:
        array = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        return None
    return np.asarray(values) if array.size >= LONG else None


def condensed(array: Any) -> list[Any]:
    """Digest, size and some elements of an array."""
    values = np.ascontiguousarray(array).ravel()
    some = values[np.linspace(0, len(values) - 1, SHOWN).astype(int)].tolist() if len(values) else []
    return [hashlib.sha256(values.tobytes()).hexdigest()[:32], len(values), *some]
