"""Estimates that a learner keeps: of trailers that are not coupled, and in a JSON file."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fifthwheel.base.errors import SignalError
from fifthwheel.base.input_files import FileKind
from fifthwheel.base.types import Array, selected
from fifthwheel.estimate.identify.one_stage.prior import JointPrior
from fifthwheel.estimate.identify.stored import Matrix, Vector, restored
from fifthwheel.estimate.identify.unknowns.unknown import Unknown

LEARNER_FILE = FileKind(
    kind="fifthwheel learner", version=3, title="a learner", writer="Learner.save", renew="start with a new Learner"
)


@dataclass(frozen=True, kw_only=True, eq=False)
class EstimateBlock:
    """Estimates of some unknowns, without their correlation with all others."""

    names: tuple[str, ...]
    centre: tuple[float, ...]  # with `scale` the meaning of z
    scale: tuple[float, ...]
    z: Vector  # (n,)
    Pz: Matrix  # covariance of z (n, n)

    @classmethod
    def of(cls, unknowns: Sequence[Unknown], z: Array, Pz: Array) -> "EstimateBlock":
        """All unknowns, with z (n,) and its covariance (n, n)."""
        names, centre, scale = (tuple(getattr(u, key) for u in unknowns) for key in ("name", "centre", "scale"))
        return cls(names=names, centre=centre, scale=scale, z=z, Pz=Pz)

    def among(self, places: Sequence[int]) -> "EstimateBlock":
        """The estimates of the unknowns at some places."""
        own: EstimateBlock = selected(self, places)
        return own

    def restricted(self, unknowns: Sequence[Unknown]) -> "EstimateBlock":
        """The estimates of those that are among some unknowns with the same prior."""
        priors = {u.name: (u.centre, u.scale) for u in unknowns}
        own = zip(self.names, self.centre, self.scale, strict=True)
        return self.among(
            [i for i, (n, *prior) in enumerate(own) if n in priors and np.allclose(priors[n], prior, rtol=1e-9)]
        )

    @classmethod
    def restored(cls, content: Any) -> "EstimateBlock":
        """The block that was `stored`; a ValueError for any other content."""
        block: EstimateBlock = restored(cls, content)
        n = len(block.names)
        if {len(column) for column in (block.centre, block.scale, block.z, *block.Pz, block.Pz)} != {n}:
            raise ValueError("the sizes of names, z and Pz differ")
        Pz = block.Pz.reshape(n, n)
        if n:
            np.linalg.cholesky(Pz)  # LinAlgError, a ValueError, if it is not positive definite
        return replace(block, Pz=(Pz + Pz.T) / 2)


def combine_blocks(
    unknowns: Sequence[Unknown], blocks: Iterable[tuple[EstimateBlock, str]], earlier: JointPrior | None = None
) -> tuple[Array, Array]:
    """z (n_p,) and its covariance (n_p, n_p) from blocks, which are uncorrelated; the prior for all other unknowns.

    Each block has a title for the message of an error. `earlier` is the information of earlier logs on unknowns of no
    block, with the widening by model error. A SignalError: an unknown of a block does not exist, or has another prior.
    """
    z, Pz = np.zeros(len(unknowns)), np.eye(len(unknowns))
    by_name = {u.name: (i, u) for i, u in enumerate(unknowns)}
    if earlier is not None:
        places = [by_name[name][0] for name in earlier.names]
        z[places] = earlier.mean
        Pz[np.ix_(places, places)] = earlier.covariance * np.outer(earlier.widening, earlier.widening)
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
