"""Score tests that allow for tyres whose stiffness varies from bend to bend.

The effective cornering stiffness of a real tyre depends on slip, load and longitudinal force, so it differs between two
bends. A constant stiffness leaves residuals that repeat with every bend, and over minutes they look like evidence
against another assumption. The tests therefore treat the stiffness C of every axle group as C exp(d_w) in each window w
of the logs, d_w ~ N(0, s^2). With the gradient g_w and the information H_w of the window, and with the indices C of the
stiffnesses, the windows explain

    gradient       sum_w H_w,:C (I / s^2 + H_w,CC)^-1 g_w,C
    information    sum_w H_w,:C (I / s^2 + H_w,CC)^-1 H_w,C:

which `score_tests` gets subtracted. A fault acts alike in all windows, so nearly all evidence for it remains. The
states at the start of a window are taken as known: the response of a truck to its former stiffness lasts about 1 s.
"""

import numpy as np
from numpy.typing import NDArray

from fifthwheel._types import Array
from fifthwheel.identify.one_stage.problem import Problem
from fifthwheel.names import ParameterPath

VARIATION = 0.05
"""Standard deviation of the variation, fraction, for typically softening tyres. By Fiala (1954) the stiffness falls by
a / (3 mu g) at the lateral acceleration a: between 0 and 2 m/s^2, that of everyday driving, by 0 to 8 %."""
WINDOW = 8.0
"""Length of a window, s: that of a lane change or a bend."""


class StiffnessVariation:
    """What the variation explains of the gradient and of the information of the logs.

    Args:
        problem: with the considered softening of its settings; without it the tyres are linear, and nothing is
            explained.
        values: of the unknowns by name, SI.
    """

    def __init__(self, problem: Problem, values: dict[str, float]) -> None:
        k, softening = len(problem.names), problem.settings.consider.get("softening", 0.0)
        stiffnesses = {u.name: u for u in problem.unknowns if _is_stiffness(u.name) and softening > 0}
        self._indices: NDArray[np.int64] = np.array([problem.names.index(name) for name in stiffnesses], dtype=np.int64)
        sigma = [VARIATION * softening * values[n] / u.slope(values[n]) for n, u in stiffnesses.items()]
        self._prior_information = np.diag([s**-2 for s in sigma])
        self.gradient, self.information = np.zeros(k), np.zeros((k, k))
        self._window_gradient, self._window_information = np.zeros(k), np.zeros((k, k))
        self._duration = 0.0

    def add(self, duration: float, indices: NDArray[np.int64], gradient: Array, information: Array) -> None:
        """Add samples of a duration, s: gradient (n,) and information (n, n) of the loss along n unknowns."""
        self._window_gradient[indices] += gradient
        self._window_information[np.ix_(indices, indices)] += information
        self._duration += duration
        if self._duration >= WINDOW:
            self.end_window()

    def end_window(self) -> None:
        """End a window, also where a segment ends."""
        C, H = self._indices, self._window_information
        gain = H[:, C] @ np.linalg.inv(self._prior_information + H[np.ix_(C, C)])
        self.gradient += gain @ self._window_gradient[C]
        self.information += gain @ H[C]
        self._window_gradient[:], self._window_information[:], self._duration = 0.0, 0.0, 0.0


def _is_stiffness(name: str) -> bool:
    return ParameterPath.of(name).quantity == "cornering_stiffness"
