"""Identifications and states on a terminal, with the words and numbers of the report."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from fifthwheel.diagnose.fit_quality import FitQuality, fit_quality
from fifthwheel.diagnose.state_summary import StateSummary, summarise_states
from fifthwheel.formatting import approximate, percent, relative, with_sigma
from fifthwheel.identify import Estimate, Fit, Identification
from fifthwheel.observe import States
from fifthwheel.record import Record
from fifthwheel.record.signal_names import si_unit
from fifthwheel.report.terminal.page import COLOURS, TerminalPage
from fifthwheel.report.text.conclusion import Conclusion, conclude_identification, conclude_states
from fifthwheel.report.text.words import STATUSES, sentence, spoken_verdict

if TYPE_CHECKING:
    from rich.console import Console


def show_identification(
    identification: Identification, console: "Console | None" = None, conclusion: Conclusion | None = None
) -> None:
    """Print parameters with sigma and verdict, derived quantities, the fit, cautions and next steps.

    Args:
        conclusion: of the identification with its logs and states; without it, one from the identification alone.
    """
    page = TerminalPage(console)
    conclusion = conclusion or conclude_identification(identification)
    page.headline(conclusion.headline, good=conclusion.good)
    estimates = (*identification.parameters, *identification.derived)
    page.table(
        ("Parameter", "Value>", "± %>", "Verdict"), map(_estimate, estimates), [COLOURS[e.verdict] for e in estimates]
    )
    for log in dict.fromkeys(fit.log for fit in identification.fits):
        fits = [fit for fit in identification.fits if fit.log == log]
        head = log if fits[0].identified_on else f"{log} (validation log)"
        rows = [_fit(fit, fit_quality(fit, identification.settings.noise)) for fit in fits]
        page.table((head, "Explained>", "Residual rms>", "Noise>"), rows)
    _show_lists(page, conclusion)


def show_states(
    states: Sequence[States],
    records: Sequence[Record],
    console: "Console | None" = None,
    conclusion: Conclusion | None = None,
) -> None:
    """Print how reliable the states of each record are, their uncertainty, cautions and next steps."""
    page = TerminalPage(console)
    conclusion = conclusion or conclude_states(states, records)
    page.headline(conclusion.headline, good=conclusion.good)
    for s in states:
        summary = summarise_states(s, records)
        page.table(
            (summary.name, "2 sigma, median>", "rms from reference>"), [_state(summary, name) for name in s.values]
        )
        statuses = [f"{percent(fraction)} {STATUSES[status]}" for status, fraction in summary.status.items()]
        page.line(f"Samples: {'; '.join(statuses)}")
        if summary.lift_warning is not None:
            page.line(sentence(str(summary.lift_warning)))
        page.table(
            ("Measured", "Innovation rms, sigma>", "Rejected>"),
            [
                (name, f"{size.rms:.2f}" if np.isfinite(size.rms) else "–", percent(size.rejected))
                for name, size in summary.innovations.items()
            ],
        )
    _show_lists(page, conclusion)


def _show_lists(page: TerminalPage, conclusion: Conclusion) -> None:
    page.lists(("Cautions", conclusion.cautions), ("Next steps", conclusion.next_steps), ("Notes", conclusion.notes))


def _estimate(e: Estimate) -> tuple[str, ...]:
    per_cent = relative(e.value, e.sigma).removesuffix(" %").replace("> ", ">")
    return e.name, with_sigma(e.value, e.sigma, e.unit), per_cent, spoken_verdict(e.verdict)


def _fit(fit: Fit, quality: FitQuality) -> tuple[str, ...]:
    unit = si_unit(fit.signal)
    noise = approximate(quality.noise, unit) if np.isfinite(quality.noise) else "–"
    return fit.signal, percent(max(fit.explained, 0.0), round_down=True), approximate(fit.rms, unit), noise


def _state(summary: StateSummary, name: str) -> tuple[str, ...]:
    """Width of the band and difference from the reference of a state."""
    values = (summary.band[name], summary.reference_rms[name])
    return (name, *["–" if value is None else approximate(value, si_unit(name)) for value in values])
