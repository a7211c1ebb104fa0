"""Scaled parameters z of order one: p = centre exp(scale z) for a logarithmic parameter, else p = centre + scale z."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from fifthwheel.base.types import Array

PRECISION = 1e-11
"""Smallest noise variance of a channel, relative to the variance that is caused by the parameters."""


@dataclass(frozen=True, kw_only=True)
class Scaling:
    """Relation of the scaled parameters z and the parameters p; one entry for each parameter in the model's order."""

    logarithmic: tuple[bool, ...]  # whether p is positive and scaled by its logarithm
    centre: Array  # p at z = 0
    scale: Array  # prior standard deviation of ln p if logarithmic, else of p
    lower: Array  # lower bound of p; finite, positive if logarithmic
    upper: Array  # upper bound of p

    def to_p(self, z: Array) -> Array:
        """Parameters p of z (..., n_p)."""
        log = np.array(self.logarithmic)
        return np.where(log, self.centre * np.exp(np.where(log, self.scale * z, 0.0)), self.centre + self.scale * z)

    def to_z(self, p: Array) -> Array:
        """z of parameters p (..., n_p)."""
        log = np.array(self.logarithmic)
        ratio = np.where(log, p / np.where(log, self.centre, 1.0), 1.0)
        return np.where(log, np.log(ratio), p - self.centre) / self.scale

    def slope(self, p: Array) -> Array:
        """dp/dz at p (..., n_p)."""
        return np.where(np.array(self.logarithmic), p * self.scale, self.scale)

    def vector(self) -> Array:
        """[centre, scale, lower z, upper z] for a compiled step."""
        return np.concatenate([self.centre, self.scale, self.to_z(self.lower), self.to_z(self.upper)])


def symbolic_to_p(logarithmic: tuple[bool, ...], z: ca.SX, centre: ca.SX, scale: ca.SX) -> ca.SX:
    """Symbolic form of `Scaling.to_p`."""
    return ca.vertcat(
        *[
            centre[i] * ca.exp(scale[i] * z[i]) if log else centre[i] + scale[i] * z[i]
            for i, log in enumerate(logarithmic)
        ]
    )
