"""The public names: lazy, complete, documented, with examples that run."""

import ast
import doctest
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import fifthwheel as fw

SLOW = ("Learner",)
"""Names whose examples compile a large model."""
ROOT = Path(__file__).parents[1]
NAMES = [name for name in fw.__all__ if name != "__version__"]


def run(code):
    """What a new process prints."""
    completed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return completed.stdout.strip()


def test_nothing_is_imported_before_its_first_use():
    loaded = run("import sys, fifthwheel; print([m for m in sys.modules if m.startswith(('fifthwheel.', 'numpy'))])")
    assert loaded == "['fifthwheel.base', 'fifthwheel.base.lazy']"


def test_type_checkers_and_run_time_agree():
    tree = ast.parse(Path(fw.__file__).read_text(encoding="utf-8"))
    (block,) = [node for node in tree.body if isinstance(node, ast.If)]
    seen: dict[str, object] = {}
    exec(compile(ast.Module(block.body, []), fw.__file__, "exec"), seen)
    assert all(seen[name] is getattr(fw, name) for name in NAMES)
    assert seen.keys() - {"__builtins__", "get"} == set(NAMES)


def test_the_public_names_are_listed_and_another_is_an_attribute_error():
    assert dir(fw) == sorted(fw.__all__)
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
    if name == "design_experiment":  # a minute; docs/howto/plan.md shows the same search
        return
    failures: list[str] = []
    doctest.DocTestRunner(verbose=False).run(example, out=failures.append)
    assert not failures, "".join(failures)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda truck, record: fw.identify(record, truck), r"records: expected a list .*write \[record\]"),
        (lambda truck, record: fw.identify([record], "truck.toml"), r"vehicle: .* got str; use fw\.Vehicle\.load"),
        (lambda truck, record: fw.linear_system(truck, 80.0), r"speed: .* up to 60, got 80\.0; convert km/h"),
        (lambda truck, record: fw.vehicle("my/truck.toml"), r"no such vehicle .*fw\.Vehicle\.load reads a file"),
    ],
)
def test_a_wrong_kind_of_argument_is_refused_with_the_cure(call, message) -> None:
    truck = fw.vehicle("cheng_cebon_2011")
    with pytest.raises(fw.FifthwheelError, match=message):
        call(truck, fw.simulate(truck, count=1))
