"""What a learner keeps when another trailer is coupled or the engine stops: blocks of unknowns, and their file."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fifthwheel.errors import SignalError
from fifthwheel.identify.parameters import Unknown
from fifthwheel.whole import whole

Array = NDArray[np.float64]
FORMAT = "fifthwheel learner 1"


@dataclass(frozen=True, kw_only=True)
class Block:
    """Some unknowns and what is known of them, apart from all others."""

    names: tuple[str, ...]
    centre: tuple[float, ...]  # with `scale` what z means
    scale: tuple[float, ...]
    z: Array  # (n,)
    Pz: Array  # (n, n)

    @classmethod
    def of(cls, unknowns: Sequence[Unknown], z: Array, Pz: Array, which: Sequence[int]) -> "Block":
        """The unknowns at some places of z (n_p,) and its covariance."""
        chosen = [unknowns[i] for i in which]
        return cls(
            names=tuple(u.name for u in chosen),
            centre=tuple(u.centre for u in chosen),
            scale=tuple(u.scale for u in chosen),
            z=z[list(which)],
            Pz=Pz[np.ix_(which, which)],
        )

    def put(self, unknowns: Sequence[Unknown], z: Array, Pz: Array, title: str) -> None:
        """Write the block where its unknowns are; they then hang together with no others.

        Raises:
            SignalError: one of them is not there, or means another thing.
        """
        places = {u.name: i for i, u in enumerate(unknowns)}
        for name, centre, scale in zip(self.names, self.centre, self.scale, strict=True):
            u = unknowns[places[name]] if name in places else None
            if u is None or not np.allclose((u.centre, u.scale), (centre, scale), rtol=1e-9):
                raise SignalError(
                    f"{name}: learned of {title} for another vehicle file, other signals or settings; "
                    "give the same ones, or another name"
                )
        which = [places[name] for name in self.names]
        Pz[which, :] = Pz[:, which] = 0.0
        Pz[np.ix_(which, which)] = self.Pz
        z[which] = self.z

    def as_dict(self) -> dict[str, Any]:
        return {
            "names": self.names,
            "centre": self.centre,
            "scale": self.scale,
            "z": self.z.tolist(),
            "Pz": self.Pz.tolist(),
        }

    @classmethod
    def from_dict(cls, told: Mapping[str, Any]) -> "Block":
        """What `as_dict` gave; ValueError or TypeError where it cannot be that."""
        z, Pz = np.array(told["z"], dtype=np.float64), np.array(told["Pz"], dtype=np.float64)
        n = len(told["names"])
        if z.shape != (n,) or Pz.shape != (n, n) or not (np.isfinite(z).all() and np.isfinite(Pz).all()):
            raise ValueError("sizes differ")
        if n:
            np.linalg.cholesky(Pz)  # LinAlgError, a ValueError, where it is no covariance
        return cls(
            names=tuple(told["names"]),
            centre=tuple(told["centre"]),
            scale=tuple(told["scale"]),
            z=z,
            Pz=(Pz + Pz.T) / 2,
        )


def write(path: Path, content: Mapping[str, Any]) -> None:
    """One JSON file, whole or not at all, with a digest of its content."""
    text = json.dumps({"format": FORMAT, "digest": _digest(content), "content": content}, allow_nan=False)
    with whole(path) as part:
        part.write_text(text + "\n", encoding="utf-8")


def read(path: Path) -> dict[str, Any]:
    """The content that `write` wrote.

    Raises:
        SignalError: the file is damaged, or of another kind.
    """
    try:
        told = json.loads(Path(path).read_text(encoding="utf-8"))
    except ValueError as error:
        raise SignalError(f"{path}: no JSON, damaged or of another kind; expected what Learner.save wrote") from error
    if not isinstance(told, dict) or told.get("format") != FORMAT:
        found = told.get("format") if isinstance(told, dict) else type(told).__name__
        raise SignalError(f"{path}: expected {FORMAT!r} as its format, got {found!r}; give a file of Learner.save")
    content = told.get("content")
    if not isinstance(content, dict) or told.get("digest") != _digest(content):
        raise SignalError(f"{path}: damaged, its content is not what its digest says; take an older copy")
    return content


def _digest(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True, allow_nan=False).encode()).hexdigest()
