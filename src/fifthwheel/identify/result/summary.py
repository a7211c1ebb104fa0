"""An identification as a table of text, and of HTML."""

from collections.abc import Iterable, Sequence

from fifthwheel._html import Markup, table
from fifthwheel.formatting import percent, relative, with_sigma
from fifthwheel.identify.result.parts import Estimate, Fit

HEADS = ("Parameter", "Value", "± %", "Verdict")
FIT_HEADS = ("Log", "Signal", "Explained")


def estimate_row(estimate: Estimate) -> tuple[str, str, str, str]:
    """Name, value with sigma and unit, sigma in per cent, verdict."""
    per_cent = relative(estimate.value, estimate.sigma).removesuffix(" %").replace("> ", ">")
    value = with_sigma(estimate.value, estimate.sigma, estimate.unit)
    return estimate.name, value, per_cent, estimate.verdict.replace("_", " ")


def fit_row(fit: Fit) -> tuple[str, str, str]:
    """Log, signal, and the fraction of its variance that the model explains."""
    log = fit.log if fit.identified_on else f"{fit.log} (validation)"
    return log, fit.signal, percent(max(fit.explained, 0.0), round_down=True)


def text(title: str, estimates: Iterable[Estimate], fits: Iterable[Fit], notes: Iterable[str]) -> str:
    """Tables of estimates and fits, and notes, in aligned lines."""
    parts = [title, _aligned(HEADS, map(estimate_row, estimates))]
    if rows := list(map(fit_row, fits)):
        parts.append(_aligned(FIT_HEADS, rows))
    return "\n\n".join([*parts, *["\n".join(f"- {note}" for note in notes)]]).rstrip()


def html_tables(estimates: Iterable[Estimate], fits: Iterable[Fit]) -> tuple[Markup, Markup]:
    """The same tables as HTML."""
    return table(HEADS, map(estimate_row, estimates)), table(FIT_HEADS, map(fit_row, fits))


def _aligned(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Rows in columns of equal width: the second and third column to the right."""
    lines = [heads, *rows]
    widths = [max(len(line[k]) for line in lines) for k in range(len(heads))]
    return "\n".join(
        "  ".join(
            cell.rjust(width) if k in (1, 2) and len(heads) == 4 else cell.ljust(width)
            for k, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    )
