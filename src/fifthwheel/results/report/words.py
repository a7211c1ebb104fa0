"""The words for verdicts, statuses and names, the same on the page and on a terminal."""

from fifthwheel.estimate.identify import Estimate, Verdict
from fifthwheel.results.diagnose.cautions import has_wide_sigma

MARKS = {
    Verdict.CONVERGED: "✓",
    Verdict.DOUBTFUL: "‽",
    Verdict.NOT_CONVERGED: "…",
    Verdict.NOT_EXCITED: "?",
    Verdict.NOT_IDENTIFIABLE: "∥",
    Verdict.AT_BOUND: "!",
    Verdict.STATED: "=",
    Verdict.FIXED: "=",
}
"""Verdict -> mark."""
WIDE_MARK = "≈"
"""Mark of a converged estimate with a wide sigma."""
STATUSES = {
    "OK": "measured",
    "COASTING": "coasting (no recent measurement)",
    "TOO_SLOW": "too slow for the model",
    "INPUT_MISSING": "speed or steer angle missing",
    "INCONSISTENT": "inconsistent (the measurements contradict the vehicle, the speed or the steer angle)",
    "SETTLING": "settling (too few samples since the start of the filter)",
}
"""Status of a sample of states -> words."""


def mark(estimate: Estimate) -> str:
    """The mark of an estimate's verdict."""
    return WIDE_MARK if has_wide_sigma(estimate) else MARKS[estimate.verdict]


def spoken_verdict(verdict: Verdict, *, predicted: bool = False) -> str:
    """A verdict in words, such as "not excited"; a predicted "converged" is "identifiable"."""
    return "identifiable" if predicted and verdict is Verdict.CONVERGED else verdict.replace("_", " ")


def counted(count: int, noun: str) -> str:
    """A number with its noun: "1 log", "2 logs"."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def sentence(text: str) -> str:
    """A text with a capital letter and a full stop."""
    return text[0].upper() + text[1:] + "."
