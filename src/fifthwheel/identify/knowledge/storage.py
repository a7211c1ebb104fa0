"""The file of what is known of a truck: knowledge.json, with the information of every log."""

import datetime
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fifthwheel._types import Array
from fifthwheel.checked_json import Format
from fifthwheel.errors import SignalError
from fifthwheel.filters.model import pack_array, unpack_array
from fifthwheel.identify.knowledge.information import LogKnowledge, SharedInformation

KNOWLEDGE = "knowledge.json"
FILE = Format(
    kind="fifthwheel knowledge",
    version=1,
    title="the knowledge of a truck",
    writer="`fifthwheel identify`",
    renew="identify the logs again",
)
_LOG = ("name", "tractor", "trailer", "load", "digest", "set_aside")
"""Texts of a log."""


def write(path: Path, logs: Sequence[LogKnowledge]) -> None:
    """Write the file."""
    FILE.write(path, {"logs": [_contents(log) for log in logs]})


def read(path: Path) -> tuple[LogKnowledge, ...]:
    """The logs in a file, or in a folder with one.

    Raises:
        SignalError: the file cannot be read, or another program wrote it.
    """
    path = path / KNOWLEDGE if path.is_dir() else path
    content = FILE.read(path)
    try:
        return tuple(_log(log) for log in content["logs"])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise SignalError(f"{path}: not what {FILE.writer} writes ({error}); {FILE.renew}") from None


def _contents(log: LogKnowledge) -> dict[str, Any]:
    own = log.information
    origins = own.origins or ("",) * len(own.names)
    columns = (own.names, own.centre, own.scale, own.logarithmic, own.non_negative, origins, own.vector)
    unknowns = [
        {
            "name": name,
            "centre": float(centre),
            "scale": float(scale),
            "logarithmic": bool(logarithmic),
            "non_negative": bool(non_negative),
            "origin": of,
            "vector": float(v),
        }
        for name, centre, scale, logarithmic, non_negative, of, v in zip(*columns, strict=True)
    ]
    return {
        **{name: getattr(log, name) for name in _LOG},
        "date": log.date.isoformat(),
        "estimated": list(log.estimated),
        "masses": dict(log.masses),
        "changed": list(log.changed),
        "factors": dict(own.factors),
        "unknowns": unknowns,
        "information": pack_array(own.information).tolist(),
        "score_covariance": pack_array(own.score_covariance).tolist(),
    }


def _log(contents: Mapping[str, Any]) -> LogKnowledge:
    unknowns, texts = contents["unknowns"], {name: contents[name] for name in _LOG}
    if not all(isinstance(text, str) for text in texts.values()):
        raise TypeError(f"{_LOG} of a log: expected texts")
    return LogKnowledge(
        **texts,
        date=datetime.datetime.fromisoformat(contents["date"]),
        estimated=tuple(map(str, contents["estimated"])),
        changed=tuple(map(str, contents["changed"])),
        masses=_named(contents["masses"]),
        information=SharedInformation(
            names=tuple(str(u["name"]) for u in unknowns),
            centre=_numbers(u["centre"] for u in unknowns),
            scale=_numbers(u["scale"] for u in unknowns),
            logarithmic=np.array([u["logarithmic"] is True for u in unknowns]),
            non_negative=np.array([u["non_negative"] is True for u in unknowns]),
            origins=tuple(str(u["origin"]) for u in unknowns),
            factors=_named(contents["factors"]),
            vector=_numbers(u["vector"] for u in unknowns),
            information=_matrix(contents["information"], len(unknowns)),
            score_covariance=_matrix(contents["score_covariance"], len(unknowns)),
        ),
    )


def _numbers(values: Any) -> Array:
    numbers = np.array([float(value) for value in values])
    if not np.isfinite(numbers).all():
        raise ValueError("a number that is not finite")
    return numbers


def _named(values: Mapping[str, Any]) -> dict[str, float]:
    """Positive numbers by name."""
    numbers = _numbers(values.values())
    if not (numbers > 0).all():
        raise ValueError("a factor or mass that is not above 0")
    return dict(zip(map(str, values), map(float, numbers), strict=True))


def _matrix(values: Any, n: int) -> Array:
    numbers = _numbers(values)
    if len(numbers) != n * (n + 1) // 2:
        raise ValueError(f"a matrix of {len(numbers)} numbers for {n} unknowns")
    return unpack_array(numbers, n)
