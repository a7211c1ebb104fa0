"""One run of the model through a segment: its residuals and their derivatives, in both forms."""

from collections.abc import Iterator

import numpy as np

from fifthwheel.base.native import AdjointScan, DirectionScan
from fifthwheel.base.types import Array, Indices
from fifthwheel.estimate.filters import tangent
from fifthwheel.estimate.filters.step_rows import StepRows
from fifthwheel.estimate.identify.one_stage.likelihood import ResidualBlock


def segment_blocks(
    scan: AdjointScan | DirectionScan,
    rows: StepRows,
    start: tuple[Array, Array],
    constant: Array,
    directions: Array,
    indices: Indices,
) -> Iterator[ResidualBlock]:
    """The outputs [residual, variance, used] of a scan for m channels at the samples of the segment.

    `start` has the carry and its derivatives along k `directions` (k, n_p) of the parameters, which belong to the
    unknowns with these `indices` (k,).
    """
    chunks = tangent.run_in_chunks(
        scan, rows, start=start[0], start_directions=start[1], constant=constant, directions=directions
    )
    for chunk in chunks:
        in_chunk, in_rows = _samples(rows, chunk.rows)
        values, slopes = chunk.values[in_chunk], chunk.slopes[in_chunk]
        m = values.shape[1] // 3
        yield ResidualBlock(
            time=rows.time[in_rows],
            error=np.where(values[:, 2 * m :] > 0, values[:, :m], np.nan),
            variance=values[:, m : 2 * m],
            jacobian=slopes[:, :m],
            variance_jacobian=slopes[:, m:] if slopes.shape[1] > m else None,
            indices=indices[chunk.directions],
        )


def _samples(rows: StepRows, chunk: slice) -> tuple[slice | Indices, slice | Indices]:
    """Which rows of a chunk are samples, counted from the start of the chunk and from the start of the segment."""
    if len(rows.sample_indices) == len(rows):  # all are; a slice avoids a copy
        return slice(None), chunk
    first, last = np.searchsorted(rows.sample_indices, (chunk.start, chunk.stop))
    indices = rows.sample_indices[first:last]
    return indices - chunk.start, indices
