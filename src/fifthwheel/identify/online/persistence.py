"""Estimates that a learner keeps: of trailers that are not coupled, and in a JSON file."""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fifthwheel._atomic import atomic_write
from fifthwheel._types import Array
from fifthwheel.errors import FifthwheelError, SignalError
from fifthwheel.identify.unknowns.unknown import Unknown
from fifthwheel.input_files import read_json

KIND, VERSION = "fifthwheel learner", 3
"""The format of a file is "fifthwheel learner 3"."""


@dataclass(frozen=True, kw_only=True, eq=False)
class EstimateBlock:
    """Estimates of some unknowns, without their correlation with all others."""

    names: tuple[str, ...]
    centre: tuple[float, ...]
    """With `scale` the meaning of z."""
    scale: tuple[float, ...]
    z: Array
    """(n,)."""
    Pz: Array
    """Covariance of z (n, n)."""

    @classmethod
    def of(cls, unknowns: Sequence[Unknown], z: Array, Pz: Array, places: Sequence[int]) -> "EstimateBlock":
        """The unknowns at some places of z (n_p,) and its covariance (n_p, n_p)."""
        chosen = [unknowns[i] for i in places]
        return cls(
            names=tuple(u.name for u in chosen),
            centre=tuple(u.centre for u in chosen),
            scale=tuple(u.scale for u in chosen),
            z=z[list(places)],
            Pz=Pz[np.ix_(places, places)],
        )

    def restricted(self, unknowns: Sequence[Unknown]) -> "EstimateBlock":
        """The estimates of those that are among some unknowns with the same prior."""
        priors = {u.name: (u.centre, u.scale) for u in unknowns}
        own = zip(self.names, self.centre, self.scale, strict=True)
        keep = [i for i, (n, *prior) in enumerate(own) if n in priors and np.allclose(priors[n], prior, rtol=1e-9)]
        return EstimateBlock(
            names=tuple(self.names[i] for i in keep),
            centre=tuple(self.centre[i] for i in keep),
            scale=tuple(self.scale[i] for i in keep),
            z=self.z[keep],
            Pz=self.Pz[np.ix_(keep, keep)],
        )

    def as_dict(self) -> dict[str, Any]:
        """The content for JSON."""
        return {
            "names": self.names,
            "centre": self.centre,
            "scale": self.scale,
            "z": self.z.tolist(),
            "Pz": self.Pz.tolist(),
        }

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> "EstimateBlock":
        """The block with the content that `as_dict` gave; KeyError, ValueError or TypeError for any other content."""
        z, Pz = np.array(content["z"], dtype=np.float64), np.array(content["Pz"], dtype=np.float64)
        n = len(content["names"])
        if z.shape != (n,) or Pz.shape != (n, n) or not (np.isfinite(z).all() and np.isfinite(Pz).all()):
            raise ValueError("the sizes of names, z and Pz differ, or they are not finite")
        if n:
            np.linalg.cholesky(Pz)  # LinAlgError, a ValueError, if it is not positive definite
        return cls(
            names=tuple(content["names"]),
            centre=tuple(content["centre"]),
            scale=tuple(content["scale"]),
            z=z,
            Pz=(Pz + Pz.T) / 2,
        )


def combine_blocks(unknowns: Sequence[Unknown], blocks: Iterable[tuple[EstimateBlock, str]]) -> tuple[Array, Array]:
    """z (n_p,) and its covariance (n_p, n_p) from blocks, which are uncorrelated; the prior for all other unknowns.

    Args:
        unknowns: (n_p,).
        blocks: with a title of each for the message of an error.

    Raises:
        SignalError: an unknown of a block does not exist, or has another prior.
    """
    z, Pz = np.zeros(len(unknowns)), np.eye(len(unknowns))
    by_name = {u.name: (i, u) for i, u in enumerate(unknowns)}
    for block, title in blocks:
        for name, centre, scale in zip(block.names, block.centre, block.scale, strict=True):
            _, u = by_name.get(name, (0, None))
            if u is None or not np.allclose((u.centre, u.scale), (centre, scale), rtol=1e-9):
                raise SignalError(
                    f"{name}: the estimates of {title} belong to another vehicle file, other signals or other "
                    "settings; give the same ones, or another name"
                )
        places = [by_name[name][0] for name in block.names]
        Pz[np.ix_(places, places)] = block.Pz
        z[places] = block.z
    return z, Pz


def write_learner(path: str | Path, content: Mapping[str, Any]) -> None:
    """Write the content of a learner to a JSON file, atomically and with a checksum."""
    document = {"format": f"{KIND} {VERSION}", "digest": _digest(content), "content": content}
    text = json.dumps(document, allow_nan=False)
    with atomic_write(path) as part:
        part.write_text(text + "\n", encoding="utf-8")


def read_learner(path: str | Path) -> dict[str, Any]:
    """The content that `write_learner` wrote.

    Raises:
        SignalError: the file cannot be read, is damaged, of another format or of another version of it.
    """
    try:
        document = read_json(Path(path))
    except FifthwheelError as error:
        raise SignalError(f"{error}; give a file that Learner.save wrote") from None
    found = document.get("format") if isinstance(document, dict) else None
    kind, _, version = str(found).rpartition(" ")
    if kind != KIND:
        raise SignalError(f"{path}: not a file of a learner; give a file that Learner.save wrote")
    if version != str(VERSION):
        raise SignalError(
            f"{path}: has format {version} of another version of fifthwheel, expected format {VERSION}; "
            "start with a new Learner, or load it with the version that wrote it"
        )
    content = document.get("content")
    if not isinstance(content, dict) or document.get("digest") != _digest(content):
        raise SignalError(f"{path}: damaged, its content does not match its checksum; restore an older copy")
    return content


def _digest(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True, allow_nan=False).encode()).hexdigest()
