"""Steps that are built only if the cache does not have their machine code."""

import os
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import fifthwheel
from fifthwheel.base.native import AdjointScan, Scan, compiled, step
from fifthwheel.base.native import step as module
from fifthwheel.base.native.llvm_ir import module as assembly
from fifthwheel.base.native.step import closure
from fifthwheel.estimate.filters import kalman, tangent
from fifthwheel.model import dynamics
from fifthwheel.truck import get
from tests.base.native.conftest import times

OUTPUTS = ("yaw_rate.tractor", "yaw_rate.semitrailer")
SOURCE = Path(fifthwheel.__file__).parent


class Factor:
    """An argument with an identity, as if a module of the package defined it."""

    __module__ = "fifthwheel.estimate.filters.model"

    def __init__(self, value: float, identity: object = None) -> None:
        self.value, self.identity = value, identity


def result(factor: Factor | float, built: list[object]) -> float:
    """As a new process computes six times the factor; `built` gets the arguments of each step that is built."""

    def build(factor: Factor | float) -> ca.Function:
        built.append(factor)
        return times(factor.value if isinstance(factor, Factor) else factor)

    build.__module__ = "fifthwheel.estimate.filters.kalman"
    return compiled(Scan)(build)(factor)(np.zeros(1), np.array([[1.0], [2], [3]]), np.ones(1))[0].item()


def test_a_step_is_built_once() -> None:
    built: list[object] = []
    assert [result(2, built) for _ in range(3)] == [12, 12, 12]
    assert built == [2]
    assert result(3, built) == 18
    assert result(True, built) == 6  # equal to 1, but another argument
    assert result(1, built) == 6
    assert built == [2, 3, True, 1]


def test_an_argument_is_identified_by_its_identity() -> None:
    """Of plain values, also inside another one; without one a step is built in every process."""
    built: list[object] = []
    assert [result(Factor(2.0, ("two", (1, None))), built) for _ in range(2)] == [12, 12]
    assert len(built) == 1
    assert result(Factor(3.0, ("three", (1, None))), built) == 18
    assert [result(Factor(value, ("model", object())), built) for value in (2.0, 3.0)] == [12, 18]
    assert [result(Factor(2.0), built), result(Factor(3.0), built), result(2.5, built)] == [12, 18, 15]
    assert len(built) == 7


def test_other_source_builds_again(monkeypatch: pytest.MonkeyPatch) -> None:
    built: list[object] = []
    result(2, built)
    monkeypatch.setattr(module, "source_digest", lambda _: b"another")
    assert (result(2, built), len(built)) == (12, 2)
    monkeypatch.setattr(module, "source_digest", lambda _: None)  # unknown
    assert (result(2, built), result(2, built), len(built)) == (12, 12, 4)


def test_source_that_may_not_be_the_imported_one_is_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    modules = frozenset({"fifthwheel.estimate.filters.kalman", "fifthwheel.model.dynamics.model"})
    newest = max(max(p.stat().st_mtime, p.stat().st_ctime) for p in closure(modules))
    digest = step.source_digest.__wrapped__
    for imported_at, known in ((newest + 1, True), (newest, False)):
        monkeypatch.setattr(fifthwheel, "imported_at", imported_at)
        assert (digest(modules) is not None) == known
        assert digest(modules | {"numpy"}) is None


def test_the_source_of_a_step_is_what_its_builder_imports() -> None:
    files = {
        str(path.relative_to(SOURCE)) for path in closure(frozenset({"fifthwheel.estimate.observe.observer_step"}))
    }
    assert {
        "model/dynamics/chain.py",
        "model/dynamics/tyres.py",
        "estimate/filters/kalman.py",
        "base/native/llvm_ir.py",
    } <= files
    assert not any(name.startswith(("results", "apps", "estimate/identify", "data/logs")) for name in files)


def test_lost_machine_code_is_compiled_again(cache_folder: Path) -> None:
    built: list[object] = []
    result(2, built)
    code = max(cache_folder.iterdir(), key=os.path.getsize)
    content = code.read_bytes()
    code.unlink()
    assert (result(2, built), len(built)) == (12, 2)
    assert code.read_bytes() == content


def test_steps_depend_on_the_topology_only() -> None:
    """The identity of a model does not contain the numbers of its vehicle; so the step must not either."""
    truck = get("cheng_cebon_2011")
    changed = truck.replace({path: 1.001 * value for path, value in truck.parameters().items()})
    assert dynamics.model(truck, (), roll=True).identity == dynamics.model(changed, (), roll=True).identity
    outputs = tuple(f"yaw_rate.{unit.name}" for unit in truck.units)
    sources = []
    for one in (truck, changed):
        dynamics.model.__globals__["_models"].clear()
        model = dynamics.model(one, outputs, roll=True)
        assert model.vehicle is one
        sources.append(assembly(kalman.kalman_step(model).step))
    assert sources[0] == sources[1]


def test_a_model_finds_the_code_of_another_process() -> None:
    """The functions of the model are not built, and the numbers are those of the step that is built."""
    truck = get("cheng_cebon_2011")
    free = ("tractor.front.cornering_stiffness",)
    results = []
    for known in (False, True):
        dynamics.model.__globals__["_models"].clear()
        model = dynamics.model(truck, OUTPUTS, roll=True, free=free, extended=True)
        scan = tangent.simulation_adjoint(model)
        assert isinstance(scan, AdjointScan)
        n, inputs, parameters, _, channels = model.sizes
        values = dynamics.all_parameters(truck, OUTPUTS, extended=True)
        constant = np.concatenate([model.free_values(values), model.known_values(values), np.ones(6)])
        arrays = (np.full(n + 2 * channels, 0.01), np.full((5, 1 + inputs + 2 * channels), 0.01), constant)
        dots = np.ones((3, n + channels)), np.ones((3, parameters))
        results.append(scan(*arrays, *dots))
        assert ("_symbols" in vars(model)) != known
    for first, second in zip(*results, strict=True):
        assert np.isfinite(first).all()
        np.testing.assert_array_equal(first, second)
