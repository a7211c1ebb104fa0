"""Values, verdicts and settling times of two stages, for histories that are chosen."""

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fifthwheel.apps.cheng_cebon_2011 import TwoStage
from fifthwheel.apps.cheng_cebon_2011.estimator import _estimates, _settling_time, _State, _TwoStages
from fifthwheel.apps.cheng_cebon_2011.problem import parameter_unknowns
from fifthwheel.apps.cheng_cebon_2011.stage import StageResult
from fifthwheel.estimate.identify.result.parts import ParameterHistory
from fifthwheel.estimate.identify.unknowns import parameters
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.truck import Vehicle

FRONT, DRIVE = "tractor.front.cornering_stiffness", "tractor.drive.cornering_stiffness"
HEIGHT = "semitrailer.payload.height"
BELOW, ABOVE = 1 - 1e-9, 1 + 1e-9


def history(
    *columns: list[float], starts: tuple[int, ...] = (0,), names: tuple[str, ...] = ("a", "b")
) -> ParameterHistory:
    values = np.column_stack(columns)
    return ParameterHistory(
        names=names[: len(columns)],
        time=0.5 * np.arange(1.0, len(values) + 1),
        values=values,
        sigma=0.1 * np.arange(values.size).reshape(values.shape),
        starts=starts,
    )


LATE, EARLY = 18 * [9.0] + 2 * [2.0], [9.0] + 10 * [3.0] + 9 * [3.02]
"""Settled since row 18 of 20, the last tenth, and since row 1."""


def after(settings: TwoStage, settled: bool, before: _State | None = None) -> _State:
    result = StageResult(
        values={"a": 5.0, "b": 6.0, "c": 7.0}, logs=(), history=history(LATE, EARLY), settled=settled, accepted=()
    )
    start = before or _State(values={}, logs=(), not_excited=frozenset(), settled={"d": True}, sigma={"d": 1.0})
    return start.after("stage 1", result, settings)


def test_the_state_after_a_stage() -> None:
    """The last value or, in the article, the average since the parameter has settled; sigma of the last sample."""
    for settled in (True, False):
        restarting = after(TwoStage(tolerance=0.01), settled)
        assert restarting.values == {"a": 5.0, "b": 6.0, "c": 7.0}
        assert restarting.settled == {"a": settled, "b": settled, "d": True}
        assert restarting.sigma == {"a": pytest.approx(3.8), "b": pytest.approx(3.9), "d": 1.0}
        article = after(TwoStage(tolerance=0.01, average=True, restart=False), settled)
        assert article.values == {"a": 2.0, "b": pytest.approx(np.mean(EARLY[1:])), "c": 7.0}
        assert article.settled == {"a": True, "b": True, "d": True}
    barely = after(TwoStage(tolerance=1e-6, restart=False), True)
    assert barely.settled == {"a": True, "b": True, "d": True}
    twice = after(TwoStage(), True, after(TwoStage(), True))
    assert twice.histories["stage 1"].passes == 2
    assert len(twice.histories["stage 1"].time) == 40


def test_a_history_that_carries_on_settles_before_its_last_tenth() -> None:
    result = StageResult(values={"a": 1.0}, logs=(), history=history(19 * [9.0] + [2.0]), settled=True, accepted=())
    state = _State(values={}, logs=(), not_excited=frozenset())
    assert state.after("stage 1", result, TwoStage(restart=False)).settled == {"a": False}
    assert state.after("stage 1", result, TwoStage(restart=True)).settled == {"a": True}


def test_settling_time() -> None:
    """Of the last pass if passes start again, else of all passes; none in the last tenth."""
    passes = history([9.0] * 3 + [2.0] * 17 + [9.0] * 5 + [2.0] * 15, starts=(0, 20))
    assert _settling_time(passes, "a", TwoStage(restart=True)) == 0.5 * 5
    assert _settling_time(passes, "a", TwoStage(restart=False)) == 0.5 * 25
    assert _settling_time(history(19 * [9.0] + [2.0]), "a", TwoStage()) is None


def verdicts(truck: Vehicle, *, trusted: bool = True, **changes: dict) -> dict[str, tuple]:
    """Verdict, value, initial value, sigma over the prior's, and stage of each parameter."""
    settings = TwoStage(given={DRIVE: "exact", HEIGHT: "+- 1 m"})
    stage_1 = parameter_unknowns(truck, [n for n in parameters.stage_1_names(truck) if n != DRIVE], settings)
    stage_2 = parameter_unknowns(truck, [HEIGHT], settings)
    names = [u.name for u in (*stage_1, *stage_2)]
    estimator = SimpleNamespace(
        settings=settings, dataset=SimpleNamespace(initial_vehicle=truck), estimated=[*stage_1, *stage_2]
    )
    given = truck.parameters()
    of_stage = [history(*[[1.0] * 20] * n, names=names) for names, n in ((tuple(names[:-1]), 3), ((HEIGHT,), 1))]
    state = SimpleNamespace(
        values={n: 1.1 * given[n] for n in names} | changes.get("values", {}),
        not_excited=frozenset(changes.get("not_excited", ())),
        histories={"stage 1": of_stage[0], "stage 2": of_stage[1]},
    )
    sigma, step = dict.fromkeys(names, 0.2) | changes.get("sigma", {}), changes.get("step", {})
    posterior = SimpleNamespace(
        names=tuple(names),
        sigma=np.array([sigma[name] for name in names]),
        next_step=lambda fixed: np.array([0.0 if name in fixed else step.get(name, 0.0) for name in names]),
    )
    unknowns = {u.name: u for u in (*stage_1, *stage_2)}
    return {
        e.name: (
            e.verdict,
            e.value / given[e.name],
            e.sigma and round(e.sigma / unknowns[e.name].slope(e.value), 9),
            e.stage,
            e.settling_time,
        )
        for e in _estimates(estimator, state, posterior, sigma, trusted=trusted)
    }


def test_verdicts(truck: Vehicle) -> None:
    """Converged if the next step moves the estimate by less than half a sigma, doubtful if the model does not explain
    the logs; excited if less than half of the variance of the prior remains, here at 1.1 times the prior mean."""
    assert verdicts(truck)[FRONT] == (Verdict.CONVERGED, pytest.approx(1.1), 0.2, 1, 0.0)
    assert verdicts(truck)[HEIGHT] == (Verdict.CONVERGED, pytest.approx(1.1), 0.2, 2, 0.0)
    assert verdicts(truck)[DRIVE] == (Verdict.FIXED, 1.0, None, 1, None)
    for edge, excited, step in ((BELOW, Verdict.CONVERGED, Verdict.CONVERGED), (ABOVE, "not_excited", "not_converged")):
        assert verdicts(truck, sigma={FRONT: edge * np.sqrt(0.5) / 1.1})[FRONT][0] == excited
        assert verdicts(truck, step={FRONT: -edge * 0.5 * 0.2})[FRONT][0] == step
        assert verdicts(truck, step={FRONT: -edge * 0.5 * 0.2})[HEIGHT][0] is Verdict.CONVERGED
    assert verdicts(truck, trusted=False)[FRONT][0] is Verdict.DOUBTFUL
    assert verdicts(truck, values={HEIGHT: 3.5})[HEIGHT][0] is Verdict.AT_BOUND
    assert verdicts(truck, not_excited=[FRONT])[FRONT] == (Verdict.NOT_EXCITED, 1.0, 1.0, 1, None)


@pytest.mark.parametrize("rounds", [1, 3, 9])
def test_both_stages_are_repeated_until_no_parameter_changes(rounds: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """By more than a tenth of sigma and of the tolerance; a parameter that still changes in the last round has not
    settled."""
    course = {"stage 1": [4.0, 2.0, 1.5, 1.4, 1.4 + 0.9e-2], "stage 2": [1.0, 1.0, 1.0, 1.0, 1.0]}
    calls: list[str] = []

    def stage(_, state: _State, title: str, problem: SimpleNamespace, active: Sequence[str], progress: None) -> _State:
        name, number = {"stage 1": "a", "stage 2": HEIGHT}[title], calls.count(title)
        assert (problem is yaw, list(active)) == (not calls, [name])
        calls.append(title)
        value = course[title][number]
        return replace(
            state,
            values={**state.values, name: value},
            sigma={**state.sigma, name: 0.1},
            settled={**state.settled, name: True},
        )

    monkeypatch.setattr(_TwoStages, "_stage", stage)
    yaw = SimpleNamespace(names=("a",))
    full = SimpleNamespace(names=("a", HEIGHT), settings=TwoStage(rounds=rounds))
    estimator = _TwoStages(dataset=None, notes=(), yaw=yaw, full=full)
    state = estimator._stages(_State(values={}, logs=(), not_excited=frozenset()), None)
    done = min(rounds, 5)
    assert calls == ["stage 1", "stage 2"] * done
    assert state.rounds == done
    assert state.values == {"a": course["stage 1"][done - 1], HEIGHT: 1.0}
    assert state.settled == {"a": rounds != 3, HEIGHT: True}


def test_parameters_without_excitation_are_found_in_several_attempts(monkeypatch: pytest.MonkeyPatch) -> None:
    """First with the yaw model and all measurements. A parameter may leave the set once; then the set only grows."""
    found = iter([{"a", "b"}, {"a"}, {"c"}, set()])
    calls: list[tuple] = []

    def posterior(problem: SimpleNamespace, _: None, values: frozenset[str], *, gated: bool = True) -> None:
        calls.append((problem.name, sorted(values), gated))

    monkeypatch.setattr(_TwoStages, "_initial", lambda _, found: SimpleNamespace(logs=None, values=found))
    monkeypatch.setattr(_TwoStages, "_stages", lambda _, state, progress: state)
    monkeypatch.setattr("fifthwheel.apps.cheng_cebon_2011.estimator.evaluate_posterior", posterior)
    monkeypatch.setattr(_TwoStages, "_not_excited", lambda *_: frozenset(next(found)))
    yaw, full = (SimpleNamespace(name=name, settings=TwoStage(restart=False)) for name in ("yaw", "full"))
    state, _ = _TwoStages(dataset=None, notes=(), yaw=yaw, full=full).solve(None)
    assert state.values == {"a", "c"}
    assert calls == [("yaw", [], False), ("full", ["a", "b"], True), ("full", ["a"], True), ("full", ["a", "c"], True)]


@pytest.mark.parametrize(
    ("steps", "restart", "unstable", "changes"),
    [
        ([(4.0, -1.0), (0.2, 0.0), (0.1, -0.1)], True, False, [(2.0, -0.5), (0.2, 0.0)]),
        ([(0.101, 0.0)] * 9, True, False, [(0.101, 0.0)] * 5),
        ([(4.0, -1.0)] * 9, False, False, []),
        ([(4.0, -1.0)] * 9, True, True, []),
    ],
)
def test_steps_of_gauss_and_newton_follow(
    monkeypatch: pytest.MonkeyPatch, steps: list, restart: bool, unstable: bool, changes: list
) -> None:
    """Five at most, of two prior sigmas at most, until the next is a tenth of a sigma; none in the article."""
    next_steps, moved = iter(steps), []

    def posterior(*_: object) -> SimpleNamespace:
        return SimpleNamespace(
            names=("a", "b"), sigma=np.ones(2), unstable=unstable, next_step=lambda _: np.array(next(next_steps))
        )

    def move(state: _State, _: object, change: dict[str, float]) -> _State:
        moved.append((change["a"], change["b"]))
        return state

    monkeypatch.setattr("fifthwheel.apps.cheng_cebon_2011.estimator.evaluate_posterior", posterior)
    monkeypatch.setattr(_State, "moved", move)
    full = SimpleNamespace(settings=TwoStage(restart=restart))
    estimator = _TwoStages(dataset=None, notes=(), yaw=None, full=full)
    estimator._refined(_State(values={}, logs=(), not_excited=frozenset()))
    assert moved == changes
