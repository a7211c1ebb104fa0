"""The words for verdicts, statuses and names, the same on the page and on a terminal."""

from typing import TYPE_CHECKING

from fifthwheel.diagnose.cautions import has_wide_sigma

if TYPE_CHECKING:
    from fifthwheel.identify import Estimate

MARKS = {
    "converged": "✓",
    "not_converged": "…",
    "not_excited": "?",
    "not_identifiable": "∥",
    "at_bound": "!",
    "fixed": "=",
}
"""Verdict -> mark."""
WIDE_MARK = "≈"
"""Mark of a converged estimate with a wide sigma."""
STATUSES = {
    "OK": "measured",
    "COASTING": "coasting (no recent measurement)",
    "TOO_SLOW": "too slow for the model",
    "INPUT_MISSING": "speed or steer angle missing",
}
"""Status of a sample of states -> words."""


def mark(estimate: "Estimate") -> str:
    """The mark of an estimate's verdict."""
    return WIDE_MARK if has_wide_sigma(estimate) else MARKS[estimate.verdict]


def verdict(name: str) -> str:
    """A verdict in words: "not_excited" -> "not excited"."""
    return name.replace("_", " ")


def predicted_verdict(name: str) -> str:
    """The verdict of a prediction: a parameter that would converge is identifiable."""
    return "identifiable" if name == "converged" else verdict(name)


def spoken(path: str) -> str:
    """A path as words: "semitrailer.cog_height" -> "semitrailer CoG height"."""
    return path.replace(".", " ").replace("_", " ").replace("cog", "CoG")


def counted(count: int, noun: str) -> str:
    """A number with its noun: "1 log", "2 logs"."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def sentence(text: str) -> str:
    """A text with a capital letter and a full stop."""
    return text[0].upper() + text[1:] + "."
