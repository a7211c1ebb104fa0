"""docs/glossary.md is complete: every term, quantity and parameter has its line."""

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[1] / "docs" / "glossary.md"

TERMS = (
    "prior, prior sigma",
    "posterior",
    "sigma",
    "conditional sigma",
    "verdict",
    "considered parameter",
    "fixed parameter",
    "uncertain number",
    "estimated parameter",
    "bias",
    "offset",
    "gain",
    "delay",
    "time base",
    "discrepancy",
    "whitening",
    "score test",
    "doubt",
    "softening",
    "misalignment",
    "play",
    "change (of a vehicle)",
    "timestamp",
    "innovation",
    "residual",
    "autocorrelation factor",
    "Fisher information",
    "identifiability",
    "excitation",
    "segment",
    "record",
    "log",
    "signal map",
    "sideslip",
    "articulation angle",
    "understeer gradient",
    "payload height",
    "relaxation length",
    "roll axis",
    "fifth wheel",
    "lane change J2179",
    "one stage",
    "two stages",
    "dual EKF",
    "joint filter",
    "smoother",
    "NIS",
    "variance budget",
)


def table(title: str) -> list[list[str]]:
    """Cells of the lines of all tables under a heading, without the header."""
    text = PAGE.read_text(encoding="utf-8")
    section = re.search(rf"^## {re.escape(title)}$(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    assert section, title
    lines = re.sub(r"^\|.*\n\|---.*\n", "", section[1], flags=re.MULTILINE).splitlines()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")]


def test_every_term_has_its_place_and_its_meaning() -> None:
    lines = [row for title in ("Estimation", "Vehicle dynamics", "Logs and records") for row in table(title)]
    assert set(TERMS) <= {row[0] for row in lines}
    for row in lines:
        assert len(row) == 3, row
        assert all(row), row


def test_modules_of_the_terms_exist() -> None:
    """Each `module` in the last column can be found in the package."""
    source = PAGE.parents[1] / "src" / "fifthwheel"
    for title in ("Estimation", "Vehicle dynamics", "Logs and records"):
        for row in table(title):
            for name in re.findall(r"`([a-z_.]+)`", row[2]):
                path = source.joinpath(*name.split("."))
                assert path.is_dir() or path.with_suffix(".py").is_file(), name


@pytest.mark.parametrize("title", ["Estimation", "Vehicle dynamics", "Logs and records"])
def test_terms_are_in_alphabetical_order(title: str) -> None:
    terms = [row[0].casefold() for row in table(title)]
    assert terms == sorted(terms)
