"""Inputs that follow from a steer angle: the contact of its play, and its rate."""

from collections.abc import Sequence

from fifthwheel.filters.step_rows import SMALLEST_PLAY


class Steering:
    """The contacts of the plays of all steer angles, sample by sample; see `step_rows.play_contact`.

    Args:
        count: number of steer angles.
    """

    def __init__(self, count: int) -> None:
        self._contacts = [0.0] * count

    def update(
        self, gap: float, last: Sequence[float], inputs: Sequence[float], plays: Sequence[float]
    ) -> tuple[list[float], list[float]]:
        """Inputs of the extended model at the beginning and at the end of a step.

        Args:
            gap: duration of the step, s.
            last, inputs: speed and steer angles before and after it.
            plays: estimates of the plays, rad; empty if they are exactly zero.
        """
        before = self._contacts
        after = list(before)
        for i, play in enumerate(plays):
            step = (inputs[1 + i] - last[1 + i]) / max(play, SMALLEST_PLAY)
            after[i] = min(0.5, max(-0.5, before[i] + step))
        self._contacts = after
        rates = [(b - a) / max(gap, 1e-3) for a, b in zip(last[1:], inputs[1:], strict=True)]
        return [*last, *before, *rates], [*inputs, *after, *rates]
