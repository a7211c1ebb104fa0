"""Where each unknown of the one-stage problem is among all elements of z."""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from fifthwheel.identify.unknowns.unknown import Unknown

Indices = NDArray[np.int64]


class ProblemLayout(NamedTuple):
    """Where each unknown is in z."""

    names: tuple[str, ...]
    unknowns: tuple[Indices, ...]  # of each log: indices of its unknowns, in their order
    initial_states: tuple[tuple[Indices, ...], ...]  # of each segment of each log; empty in the prediction-error form

    @classmethod
    def of(cls, unknowns: Sequence[Unknown], segments: Sequence[int], states: Sequence[str]) -> Self:
        """The layout for logs with these numbers of segments, each of which has these initial states."""
        names = [u.name for u in unknowns if not u.per_log]
        shared = {name: i for i, name in enumerate(names)}
        of_logs = []
        for i in range(len(segments)):
            indices = []
            for u in unknowns:
                indices.append(len(names) if u.per_log else shared[u.name])
                if u.per_log:
                    names.append(f"{u.name}@{i}")
            of_logs.append(np.array(indices, dtype=np.int64))
        initial_states = []
        for i, count in enumerate(segments):
            of_segments = []
            for j in range(count):
                of_segments.append(np.arange(len(names), len(names) + len(states)))
                names += [f"{state}@{i}.{j}" for state in states]
            initial_states.append(tuple(of_segments))
        return cls(tuple(names), tuple(of_logs), tuple(initial_states))
