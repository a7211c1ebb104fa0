"""Which parameters of one stage the logs do not determine, found in several attempts."""

from types import SimpleNamespace

import numpy as np
import pytest

from fifthwheel.identify.one_stage import estimator as module
from fifthwheel.identify.one_stage.estimator import _Estimator
from fifthwheel.identify.verdict import Verdict

NOT = Verdict.NOT_EXCITED


@pytest.mark.parametrize("stable", [True, False])
def test_the_set_may_shrink_once_and_then_only_grows(stable: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first set is that at the initial values, without considered unknowns and by part of long logs.

    It is empty for an unstable vehicle.
    """
    found = [{"a": NOT, "b": NOT}, {"a": NOT}, {"c": NOT}, {}]
    asked: list[tuple[list[str], float, bool]] = []

    def uninformed(_, problem: SimpleNamespace, z: np.ndarray, *, noise_only: bool = False) -> dict[str, Verdict]:
        asked.append((sorted(problem.uninformed), float(z[0]), noise_only))
        assert noise_only == problem.short
        return found[len(asked) - 1 + (not stable)]

    def problem(uninformed: SimpleNamespace | dict, logs: tuple) -> SimpleNamespace:
        uninformed = {} if uninformed is setup else uninformed
        short = SimpleNamespace(logs=logs, uninformed=uninformed, short=True)
        return SimpleNamespace(logs=logs, uninformed=uninformed, short=False, shortened=lambda _: short)

    setup = SimpleNamespace(considering=lambda uninformed: uninformed)
    monkeypatch.setattr(module, "Problem", problem)
    monkeypatch.setattr(_Estimator, "_initial", lambda *_: np.array([0.0 if stable else 0.5]))
    monkeypatch.setattr(_Estimator, "_uninformed", uninformed)
    monkeypatch.setattr(
        _Estimator, "_minimise", lambda _, problem, __: SimpleNamespace(objective=problem, z=np.array([1.0]))
    )
    dataset = SimpleNamespace(logs=())
    estimator = _Estimator(dataset=dataset, setup=setup, start={})
    solution = estimator.solve(None)
    first = [([], 0.0, True), (["a", "b"], 1.0, False)] if stable else [([], 1.0, False)]
    assert asked == [*first, (["a"], 1.0, False), (["a", "c"], 1.0, False)]
    assert set(solution.uninformed) == {"a", "c"}
    assert set(solution.problem.uninformed) == {"a", "c"}
