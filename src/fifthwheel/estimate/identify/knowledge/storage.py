"""The file of what is known of a truck: knowledge.json, with the information of every log."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fifthwheel.base.errors import SignalError, printable
from fifthwheel.base.input_files import FileKind
from fifthwheel.estimate.identify.knowledge.information import LogKnowledge, SharedInformation
from fifthwheel.estimate.identify.stored import reason, restored, stored

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
RANK_TOLERANCE = 1e-6
"""Negative eigenvalue of an information matrix, relative to the largest one, that rounding explains."""


def write(path: Path, logs: Sequence[LogKnowledge]) -> None:
    """Write the file, complete or not at all."""
    FILE.write(path, {"logs": stored(tuple[LogKnowledge, ...], tuple(logs))})


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
        logs = restored_logs(content.get("logs"))
    except (TypeError, ValueError, OverflowError) as error:
        text = printable(reason(error))[:MAX_REASON]
        raise SignalError(f"{path}: not what {FILE.writer} writes ({text}); {FILE.renew}") from None
    return logs


def knowledge_file(path: Path) -> Path:
    """The file that a result folder, its identification.json, or a path of a file stands for."""
    if path.is_dir():
        return path / KNOWLEDGE
    return path.with_name(KNOWLEDGE) if path.name == IDENTIFICATION else path


def restored_logs(content: object) -> tuple[LogKnowledge, ...]:
    """The logs of a file; a TypeError, ValueError or OverflowError if they are impossible."""
    logs: tuple[LogKnowledge, ...] = restored(tuple[LogKnowledge, ...], content)
    for log in logs:
        _require_possible(log.information)
    n = len({unknown for log in logs for unknown in log.unknowns})
    if n**2 * len(logs) > MAX_STATES:
        raise ValueError(f"{len(logs)} logs with {n} unknowns are too many to combine")
    return logs


def _require_possible(information: SharedInformation) -> None:
    """A ValueError if sizes differ, or a number is impossible."""
    own, n = information, len(information.names)
    if n > MAX_UNKNOWNS:
        raise ValueError(f"{n} unknowns of a log; at most {MAX_UNKNOWNS} expected")
    if len(set(own.names)) < n:
        raise ValueError("a log with two unknowns of one name")
    columns = (own.centre, own.scale, own.logarithmic, own.non_negative, own.vector, own.origins)
    if {len(column) for column in columns} != {n}:
        raise ValueError(f"columns of other lengths than {n} unknowns")
    if not (own.scale > 0).all() or not (own.centre[own.logarithmic] > 0).all():
        raise ValueError("a prior without a positive scale or median")
    for matrix in (own.information, own.score_covariance):
        if len(matrix) != n:
            raise ValueError(f"a matrix of {len(matrix)} rows for {n} unknowns")
        eigenvalues = np.linalg.eigvalsh(matrix) if n else np.zeros(1)
        if eigenvalues[0] < -RANK_TOLERANCE * max(eigenvalues[-1], 1.0):
            raise ValueError("information that is not positive semidefinite")
