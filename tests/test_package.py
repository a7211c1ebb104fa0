"""What accompanies the source: version, citation, changes and figures agree with it."""

import re
import runpy
import tomllib
from pathlib import Path

import pytest

import fifthwheel

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def text(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def test_citation_and_changes_are_of_this_version() -> None:
    assert f"\nversion: {fifthwheel.__version__}\n" in text("CITATION.cff")
    first = re.search(r"^## (\S+)", text("CHANGELOG.md"), re.MULTILINE)
    assert first
    assert first[1] == fifthwheel.__version__


def test_every_extra_is_in_the_readme() -> None:
    table = "".join(line for line in text("README.md").splitlines() if line.startswith("|"))
    for extra in PROJECT["project"]["optional-dependencies"]:
        assert f"`{extra}`" in table, extra


def test_messages_name_existing_extras() -> None:
    """`pip install 'fifthwheel[...]'` in messages and pages."""
    pages = [*(ROOT / "src").rglob("*.py"), *(ROOT / "docs").glob("**/*.md"), ROOT / "README.md"]
    named = {name for page in pages for name in re.findall(r"'fifthwheel\[([a-z,]+)\]'", page.read_text("utf-8"))}
    assert "logs" in named
    assert named <= set(PROJECT["project"]["optional-dependencies"])


def test_the_figure_of_the_readme_is_that_of_its_script(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "_figures"))
    draw = runpy.run_path(str(ROOT / "docs" / "_figures" / "vehicle_model.py"))["draw"]
    assert text("docs/_static/vehicle_model.svg") == draw(), "python docs/_figures draws it again"
