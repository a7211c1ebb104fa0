"""The public names: lazy, complete, documented, with examples that run."""

import ast
import doctest
import inspect
import subprocess
import sys
from pathlib import Path

import pytest
from mypy import api

import fifthwheel as fw

SLOW = ("Learner", "design_experiment")
"""Names whose examples compile large models."""
ROOT = Path(__file__).parents[1]
NAMES = [name for name in fw.__all__ if name != "__version__"]


def run(code):
    """What a new process prints."""
    completed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return completed.stdout.strip()


def test_nothing_is_imported_before_its_first_use():
    loaded = run("import sys, fifthwheel; print([m for m in sys.modules if m.startswith(('fifthwheel.', 'numpy'))])")
    assert loaded == "['fifthwheel.base', 'fifthwheel.base.lazy']"


def test_dir_lists_the_public_names():
    assert dir(fw) == sorted(fw.__all__)


def test_type_checkers_and_run_time_agree():
    tree = ast.parse(Path(fw.__file__).read_text(encoding="utf-8"))
    (block,) = [node for node in tree.body if isinstance(node, ast.If)]
    seen: dict[str, object] = {}
    exec(compile(ast.Module(block.body, []), fw.__file__, "exec"), seen)
    assert all(seen[name] is getattr(fw, name) for name in NAMES)
    assert seen.keys() - {"__builtins__", "get"} == set(NAMES)


@pytest.mark.slow
def test_type_checkers_see_functions_and_not_modules(tmp_path):
    code = "import fifthwheel as fw\nfrom fifthwheel.truck import laden\n"
    (tmp_path / "notebook.py").write_text(
        code + 'fw.identify([fw.simulate(fw.vehicle("a"))], fw.vehicle("a"))["a"].sigma\n'
    )
    out, _, status = api.run(["--config-file", str(ROOT / "pyproject.toml"), str(tmp_path / "notebook.py")])
    assert status == 0, out


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'idnetify'"):
        fw.idnetify  # noqa: B018


@pytest.mark.slow
def test_the_main_functions_are_functions():
    """Whatever else was imported before; so no package has their names."""
    names = ("assess", "evaluate", "identify", "simulate", "vehicle")
    code = f"import fifthwheel as fw; print([type(getattr(fw, name)).__name__ for name in {names}])"
    assert run(f"import fifthwheel.estimate.identify, fifthwheel.truck; {code}") == str(["function"] * len(names))


def test_every_public_name_and_method_is_documented():
    missing = [name for name in NAMES if not inspect.getdoc(getattr(fw, name))]
    for name in NAMES:
        for attribute, value in vars(getattr(fw, name)).items() if isinstance(getattr(fw, name), type) else ():
            value = value.__func__ if isinstance(value, classmethod | staticmethod) else value
            described = inspect.isfunction(value) or isinstance(value, property)
            if not attribute.startswith("_") and described and not (value.__doc__ or "").strip():
                missing.append(f"{name}.{attribute}")
    assert not missing


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if name in SLOW else []) for name in NAMES]
)
def test_every_public_name_has_an_example_that_runs(name):
    finder = doctest.DocTestFinder(recurse=False)
    (example,) = finder.find(getattr(fw, name), name=name, globs={}, module=False)
    assert example.examples
    failures: list[str] = []
    doctest.DocTestRunner(verbose=False).run(example, out=failures.append)
    assert not failures, "".join(failures)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda truck, record: fw.identify(record, truck), r"records: expected a list .*write \[record\]"),
        (lambda truck, record: fw.identify([record], "truck.toml"), r"vehicle: .* got str; use fw\.Vehicle\.load"),
        (lambda truck, record: fw.simulate("cheng_cebon_2011"), r"vehicle: expected a Vehicle, got str"),
        (lambda truck, record: fw.linear_system("truck", 20.0), r"vehicle: expected a Vehicle, got str"),
        (lambda truck, record: fw.linear_system(truck, 80.0), r"speed: .* up to 60, got 80\.0; convert km/h"),
        (lambda truck, record: fw.linear_system(truck, "80 km/h"), r"speed: expected a number of m/s"),
        (lambda truck, record: fw.vehicle("my/truck.toml"), r"no such vehicle .*fw\.Vehicle\.load reads a file"),
    ],
)
def test_a_wrong_kind_of_argument_is_refused_with_the_cure(call, message) -> None:
    truck = fw.vehicle("cheng_cebon_2011")
    with pytest.raises(fw.FifthwheelError, match=message):
        call(truck, fw.simulate(truck, count=1))


def test_one_output_may_be_a_name() -> None:
    system = fw.linear_system(fw.vehicle("cheng_cebon_2011"), 20.0, "yaw_rate.tractor")
    assert system.outputs == ("yaw_rate.tractor",)
    assert len(repr(system)) < 120
