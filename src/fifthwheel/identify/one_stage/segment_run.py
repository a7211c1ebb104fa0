"""One run of the model through a segment: its residuals and their derivatives, in both forms."""

from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass

import numpy as np

from fifthwheel._types import Array, Indices
from fifthwheel.dynamics import ChainModel
from fifthwheel.filters import Noise, tangent
from fifthwheel.filters.model import Model
from fifthwheel.filters.step_rows import StepRows
from fifthwheel.identify.noise_model import NoiseModel
from fifthwheel.identify.one_stage.likelihood import ResidualBlock
from fifthwheel.native import AdjointScan, DirectionScan


@dataclass(frozen=True, kw_only=True)
class SegmentRun:
    """One run through a segment: n states, n_p model parameters, k directions."""

    rows: StepRows
    p: Array  # (n_p,)
    p_directions: Array  # (k, n_p) derivative of p
    x0: Array  # (n,)
    x0_directions: Array  # (k, n) derivative of x0
    P0: Array  # (n, n) covariance of x0 for the Kalman filter
    indices: Indices  # (k,) of the unknowns that the directions belong to

    def output_errors(self, model: ChainModel, noise: Sequence[NoiseModel]) -> Iterator[ResidualBlock]:
        """The log less the free-running model, with the noise of every channel."""
        r, q, tau = (np.array(values) for values in zip(*map(astuple, noise), strict=True))
        start, start_directions = tangent.simulation_start(self.x0, q, self.x0_directions)
        constant = np.concatenate([self.p, r, q, tau])
        linear = model.tyres == "linear"
        scan = tangent.simulation_directions(model) if linear else tangent.simulation_adjoint(model)
        return self._blocks(scan, start, start_directions, constant, len(noise))

    def innovations(self, model: Model, noise: Noise) -> Iterator[ResidualBlock]:
        """The innovations of the Kalman filter and their variances."""
        start, start_directions = tangent.innovations_start(self.x0, self.P0, self.x0_directions)
        constant = np.concatenate([self.p, noise.vector()])
        scan = tangent.innovations_tangent(model)
        return self._blocks(scan, start, start_directions, constant, len(noise.measurement))

    def _blocks(
        self, scan: AdjointScan | DirectionScan, start: Array, start_directions: Array, constant: Array, m: int
    ) -> Iterator[ResidualBlock]:
        """The outputs [residual, variance, used] of a scan for m channels at the samples of the segment."""
        chunks = tangent.run_in_chunks(
            scan,
            self.rows,
            start=start,
            start_directions=start_directions,
            constant=constant,
            directions=self.p_directions,
        )
        for chunk in chunks:
            in_chunk, in_rows = _samples(self.rows, chunk.rows)
            values, slopes = chunk.values[in_chunk], chunk.slopes[in_chunk]
            yield ResidualBlock(
                time=self.rows.time[in_rows],
                error=np.where(values[:, 2 * m :] > 0, values[:, :m], np.nan),
                variance=values[:, m : 2 * m],
                jacobian=slopes[:, :m],
                variance_jacobian=slopes[:, m:] if slopes.shape[1] > m else None,
                indices=self.indices[chunk.directions],
            )


def _samples(rows: StepRows, chunk: slice) -> tuple[slice | Indices, slice | Indices]:
    """Which rows of a chunk are samples, counted from the start of the chunk and from the start of the segment."""
    if len(rows.sample_indices) == len(rows):  # all are; a slice avoids a copy
        return slice(None), chunk
    first, last = np.searchsorted(rows.sample_indices, (chunk.start, chunk.stop))
    indices = rows.sample_indices[first:last]
    return indices - chunk.start, indices
