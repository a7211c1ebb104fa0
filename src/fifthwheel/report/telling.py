"""What the logs told of each parameter, what it hangs on, and what would tell more."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from fifthwheel.report import advice
from fifthwheel.report.numbers import about, digits, listed, percent, relative
from fifthwheel.report.outlook import in_words

if TYPE_CHECKING:
    from fifthwheel.identify import Estimate, Identification
    from fifthwheel.identify.outlook import Outlook, Prospect

PARTLY = 0.5
"""From this correlation on it is told with what a parameter goes, if it is not confused with it outright."""
DEBT = 0.1
"""A part of a variance from which it is told what it comes from."""
COLOURED = 1.5
"""A sigma that is so many times what the sensors' noise leaves owes most of itself to residuals that hang together."""


@dataclass(frozen=True, kw_only=True)
class Told:
    """What is known of one parameter, and what that hangs on."""

    name: str
    unit: str
    value: float
    initial: float
    verdict: str
    before: float | None  # sigma that it was given, SI
    after: float | None  # sigma that it ended with; None where nothing was told
    noise: float | None = None  # sigma that the sensors' noise alone would have left, if that is much less
    confused: tuple[str, ...] = ()  # what it cannot be told apart from
    partly: tuple[str, float] | None = None  # or what it goes with most, and their correlation
    debts: tuple[tuple[str, float], ...] = ()  # what was only considered, and its part of the variance
    helps: tuple[str, ...] = ()  # changes, with the sigma that each would bring

    @property
    def relative(self) -> bool:
        """Whether its sigma counts as a part of its value; that of a height counts as it is."""
        return not self.name.endswith(".payload.height")

    @property
    def left(self) -> float | None:
        """How much of the prior's sigma is left, 0 to 1."""
        if not self.before:
            return None
        if self.after is None:
            return 1.0
        scale = abs(self.initial / self.value) if self.relative and self.value else 1.0
        return min(scale * self.after / self.before, 1.0)


def told(identification: "Identification", outlook: "Outlook | None" = None) -> tuple[Told, ...]:
    """Every parameter that was sought; with an outlook at the identified truck also what would help."""
    return tuple(_told(identification, e, outlook) for e in identification.parameters if e.verdict != "held")


def _told(identification: "Identification", e: "Estimate", outlook: "Outlook | None") -> Told:
    prospect = next((p for p in outlook.parameters if p.name == e.name), None) if outlook else None
    found = e.verdict in ("converged", "not_converged")
    noise = prospect.sigma if prospect and prospect.verdict == "converged" and found else None
    coloured = noise is not None and e.sigma is not None and e.sigma > COLOURED * noise
    return Told(
        name=e.name,
        unit=e.unit,
        value=e.value,
        initial=e.initial,
        verdict=e.verdict,
        before=e.prior,
        after=e.sigma,
        noise=noise if coloured else None,
        confused=e.confused_with,
        partly=None if e.confused_with else _partly(identification, e),
        debts=tuple((name, part) for name, part in advice.debts(identification, e.name) if part > DEBT),
        helps=() if prospect is None or coloured else tuple(_helps(e, prospect)),
    )


def _helps(e: "Estimate", prospect: "Prospect") -> Iterator[str]:
    """Changes that would bring its sigma down, and to what."""
    for remedy in prospect.remedies:
        if e.sigma is None or remedy.sigma < 0.9 * e.sigma:
            yield f"±{relative(prospect.value, remedy.sigma)} {in_words(remedy)}"


def _partly(identification: "Identification", e: "Estimate") -> tuple[str, float] | None:
    """What it is correlated with most, if it was estimated at all."""
    known = identification.covariance
    if known is None or e.name not in known.names or e.verdict != "converged":
        return None
    i, P = known.names.index(e.name), known.covariance
    scale = np.sqrt(np.diag(P))
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.nan_to_num(np.abs(P[i]) / (scale[i] * scale))
    held = {rough.name for rough in identification.rough if rough.verdict == "held"}
    for j, name in enumerate(known.names):
        if j == i or name in held or name.endswith("@"):
            size[j] = 0.0
    worst = int(np.argmax(size))
    return (known.names[worst], float(size[worst])) if size[worst] > PARTLY else None


def in_short(one: Told) -> str:
    """Before and after: "±30 % → ±4.4 %", of a height in its unit."""

    def size(sigma: float | None, value: float) -> str:
        if sigma is None:
            return "–"
        return f"±{relative(value, sigma) if one.relative else about(sigma, one.unit)}"

    after = size(one.after, one.value)
    return f"{size(one.before, one.initial)} → {after}" if one.before else after


def lines(one: Told) -> list[str]:
    """What its sigma hangs on and what would help, a sentence each."""
    found = []
    well = one.verdict == "converged" and one.after is not None and one.after < advice.WIDE * abs(one.value)
    if one.confused and well:
        found.append(f"Told well; what is left of its sigma goes with {listed(one.confused)}.")
    elif one.confused:
        found.append(f"Hardly told apart from {listed(one.confused)}.")
    elif one.partly:
        found.append(f"Goes partly with {one.partly[0]} (correlation {one.partly[1]:.2f}).")
    if one.debts:
        parts = ", ".join(f"{percent(part)} from {name}" for name, part in one.debts[:2])
        found.append(f"Of its variance {parts}, which the vehicle file knows only roughly.")
    if one.noise and one.after:
        times = digits(one.after / one.noise, 2)
        found.append(f"Sigma is {times} times what the sensors' noise alone would leave: the residuals hang together.")
    if one.helps:
        found.append(f"By reckoning it would be {'; '.join(one.helps)}.")
    return found


def html(found: Sequence[Told]) -> str:
    """A row a parameter: a bar of what is left of the prior's sigma, and sentences."""
    rows = []
    for one in found:
        left = 1.0 if one.left is None else one.left
        good = "told" if one.verdict == "converged" else "untold"
        name = escape(one.name).replace(".", ".<wbr>")
        bar = f'<span class="bar" aria-hidden="true"><i class="{good}" style="width:{100 * left:.1f}%"></i></span>'
        kept = "" if one.left is None else f"<small>{percent(left)} of the sigma before is left</small>"
        said = "".join(f"<li>{escape(line)}</li>" for line in lines(one))
        rows.append(
            f'<div class="told"><div><code>{name}</code>{bar}<b>{escape(in_short(one))}</b>{kept}</div>'
            f"<ul>{said}</ul></div>"
        )
    return '<div class="tolds">' + "\n".join(rows) + "</div>"
