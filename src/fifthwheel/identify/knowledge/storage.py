"""The file of what is known of a truck: knowledge.json, with the information of every log."""

import datetime
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fifthwheel._types import Array
from fifthwheel.checked_json import FileKind
from fifthwheel.errors import SignalError, printable
from fifthwheel.filters.model import pack_array, unpack_array
from fifthwheel.identify.knowledge.information import LogKnowledge, SharedInformation

KNOWLEDGE, IDENTIFICATION = "knowledge.json", "identification.json"
MAX_REASON = 200
"""Characters of the reason of an error."""
FILE = FileKind(
    kind="fifthwheel knowledge",
    version=1,
    title="the knowledge of a truck",
    writer="`fifthwheel identify`",
    renew="identify the logs again",
)
MAX_UNKNOWNS = 500
"""Shared unknowns of a log."""
MAX_STATES = 3e8
"""Numbers of the covariances that the filter over all logs keeps."""
MAX_NUMBER = 1e40
"""Magnitude of a number; squares and products of such numbers are finite."""
RANK_TOLERANCE = 1e-6
"""Negative eigenvalue of an information matrix, relative to the largest one, that rounding explains."""
_LOG = ("name", "tractor", "trailer", "load", "road", "digest", "set_aside")
"""Texts of a log."""


def write(path: Path, logs: Sequence[LogKnowledge]) -> None:
    """Write the file, complete or not at all."""
    FILE.write(path, {"logs": [log_contents(log) for log in logs]})


def read(path: Path) -> tuple[LogKnowledge, ...]:
    """The logs in a file, or in a folder with one; a SignalError if it cannot be read, another program wrote it, or its
    numbers are impossible."""
    path = knowledge_file(path)
    if not path.exists() and path.with_name(IDENTIFICATION).exists():
        raise SignalError(
            f"{path}: the result in this folder has no knowledge, because two stages or another version wrote it; "
            "identify its logs again in one stage"
        )
    content = FILE.read(path)
    try:
        logs = tuple(log_of(log) for log in _list(content["logs"]))
        _check_size(logs)
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        reason = printable(str(error).partition("\n")[0])[:MAX_REASON]
        reason = f"{reason} is missing" if isinstance(error, KeyError) else reason
        raise SignalError(f"{path}: not what {FILE.writer} writes ({reason}); {FILE.renew}") from None
    return logs


def knowledge_file(path: Path) -> Path:
    """The file that a result folder, its identification.json, or a path of a file stands for."""
    if path.is_dir():
        return path / KNOWLEDGE
    return path.with_name(KNOWLEDGE) if path.name == IDENTIFICATION else path


def _check_size(logs: Sequence[LogKnowledge]) -> None:
    """A ValueError if the logs together have more unknowns than can be combined."""
    n = len({unknown for log in logs for unknown in log.unknowns})
    if n**2 * len(logs) > MAX_STATES:
        raise ValueError(f"{len(logs)} logs with {n} unknowns are too many to combine")


def log_contents(log: LogKnowledge) -> dict[str, Any]:
    """A log for JSON."""
    own = log.information
    arrays = ("centre", "scale", "logarithmic", "non_negative", "vector")
    columns = {"name": own.names, **{name: getattr(own, name).tolist() for name in arrays}, "origin": own.origins}
    unknowns = [dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)]
    return {
        **{name: getattr(log, name) for name in _LOG},
        "date": log.date.isoformat(),
        "estimated": list(log.estimated),
        "units": dict(log.units),
        "masses": dict(log.masses),
        "changed": list(log.changed),
        "factors": dict(own.factors),
        "doubts": list(log.doubts),
        "unknowns": unknowns,
        "information": pack_array(own.information).tolist(),
        "score_covariance": pack_array(own.score_covariance).tolist(),
    }


def log_of(contents: Any) -> LogKnowledge:
    """The log of `log_contents`; a KeyError, TypeError, ValueError, AttributeError or OverflowError for others."""
    unknowns, texts = _list(contents["unknowns"]), {name: _text(contents[name]) for name in _LOG}
    if len(unknowns) > MAX_UNKNOWNS:
        raise ValueError(f"{len(unknowns)} unknowns of a log; at most {MAX_UNKNOWNS} expected")
    names = tuple(_text(u["name"]) for u in unknowns)
    if len(set(names)) < len(names):
        raise ValueError("a log with two unknowns of one name")
    centre, scale = (_numbers(u[key] for u in unknowns) for key in ("centre", "scale"))
    logarithmic = np.array([u["logarithmic"] is True for u in unknowns], dtype=bool)
    if not (scale > 0).all() or not (centre[logarithmic] > 0).all():
        raise ValueError("a prior without a positive scale or median")
    return LogKnowledge(
        **texts,
        date=_date(contents["date"]),
        estimated=_texts(contents["estimated"]),
        changed=_texts(contents["changed"]),
        doubts=_texts(contents["doubts"]),
        units=dict(zip(_texts([*contents["units"]]), _texts([*contents["units"].values()]), strict=True)),
        masses=_named(contents["masses"]),
        information=SharedInformation(
            names=names,
            centre=centre,
            scale=scale,
            logarithmic=logarithmic,
            non_negative=np.array([u["non_negative"] is True for u in unknowns], dtype=bool),
            origins=tuple(_text(u["origin"]) for u in unknowns),
            factors=_named(contents["factors"]),
            vector=_numbers(u["vector"] for u in unknowns),
            information=_matrix(contents["information"], len(unknowns)),
            score_covariance=_matrix(contents["score_covariance"], len(unknowns)),
        ),
    )


def _list(value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise TypeError(f"expected a list, got {type(value).__name__}")
    return value


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError(f"expected a text, got {type(value).__name__}")
    return value


def _texts(values: Any) -> tuple[str, ...]:
    return tuple(map(_text, _list(values)))


def _date(value: Any) -> datetime.datetime:
    date = datetime.datetime.fromisoformat(_text(value))
    if date.tzinfo is None or not 1900 <= date.year <= 2200:
        raise ValueError(f"date {value}: expected one with its time zone, such as 2026-01-01T08:00:00+00:00")
    return date.astimezone(datetime.UTC)


def _numbers(values: Iterable[Any]) -> Array:
    """Numbers of moderate magnitude as an array."""
    values = list(values)
    for value in values:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise TypeError(f"expected a number, got {type(value).__name__}")
        if not abs(value) <= MAX_NUMBER:
            raise ValueError(f"expected a number of at most {MAX_NUMBER:g}, got {value}")
    return np.array(values, dtype=float)


def _named(values: Mapping[str, Any]) -> dict[str, float]:
    """Positive numbers by name."""
    numbers = _numbers(values.values())
    if not (numbers > 0).all():
        raise ValueError("a factor or mass that is not above 0")
    return dict(zip(map(_text, values), numbers.tolist(), strict=True))


def _matrix(values: Any, n: int) -> Array:
    """A positive semidefinite matrix (n, n) from its packed numbers."""
    numbers = _numbers(_list(values))
    if len(numbers) != n * (n + 1) // 2:
        raise ValueError(f"a matrix of {len(numbers)} numbers for {n} unknowns")
    matrix = unpack_array(numbers, n)
    eigenvalues = np.linalg.eigvalsh(matrix) if n else np.zeros(1)
    if eigenvalues[0] < -RANK_TOLERANCE * max(eigenvalues[-1], 1.0):
        raise ValueError("information that is not positive semidefinite")
    return matrix
