"""docs/glossary.md has a meaning and a place for every term."""

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[1] / "docs" / "glossary.md"

TITLES = ("Estimation", "Vehicle dynamics", "Logs and records")


def table(title: str) -> list[list[str]]:
    """Cells of the lines of all tables under a heading, without the header."""
    text = PAGE.read_text(encoding="utf-8")
    section = re.search(rf"^## {re.escape(title)}$(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    assert section, title
    lines = re.sub(r"^\|.*\n\|---.*\n", "", section[1], flags=re.MULTILINE).splitlines()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")]


@pytest.mark.parametrize("title", TITLES)
def test_terms_are_in_alphabetical_order_with_meaning_and_modules_that_exist(title: str) -> None:
    """Each `module` in the last column can be found in the package."""
    source, lines = PAGE.parents[1] / "src" / "fifthwheel", table(title)
    terms = [row[0].casefold() for row in lines]
    assert terms == sorted(terms)
    for row in lines:
        assert len(row) == 3, row
        assert all(row), row
        for name in re.findall(r"`([a-z_.]+)`", row[2]):
            path = source.joinpath(*name.split("."))
            assert path.is_dir() or path.with_suffix(".py").is_file(), name
