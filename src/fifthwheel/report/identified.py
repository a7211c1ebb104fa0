"""The sections of a report that an identification fills."""

from collections.abc import Iterator, Sequence
from html import escape
from typing import TYPE_CHECKING

from fifthwheel.report import facts, figures, tables, telling
from fifthwheel.report.numbers import about, percent, with_sigma
from fifthwheel.report.sheet import Row, Sheet
from fifthwheel.report.table import path

if TYPE_CHECKING:
    from fifthwheel.identify import Fit, Identification
    from fifthwheel.identify.outlook import Outlook


def parameters(sheet: Sheet, found: "Identification") -> None:
    """What was sought, what follows from it, what was known roughly, and the sensors' errors."""
    sheet.heading("parameters", "Parameters")
    last = "" if found.method == "one-stage" else ", in the last pass,"
    sheet.hint(
        "Sigma is one standard deviation, from the logs and what was assumed beforehand; before is that assumption, "
        "the prior. Values in grey are no findings: the vehicle file's, or those where the search began. Settled "
        f"after: driving time{last} from which the value stayed within {percent(found.settings.tolerance)} of its "
        "average (–: never)."
    )
    sheet.html(tables.estimates(found.parameters))
    if found.derived:
        sheet.part("What follows from the load")
        sheet.hint("CoG of the laden sprung body above the ground; its roll inertia about the roll axis.")
        sheet.html(tables.estimates(found.derived, history=False))
    if found.sensors:
        sheet.part("Errors of the sensors")
        sheet.hint(
            "Estimated beside the parameters: a sensor shows the truth plus its zero; wheels turn by gain × (shown − "
            "zero)."
        )
        sheet.html(tables.sensors(found))
    banks = [f"{log.name} {with_sigma(*log.bank, 'rad')}" for log in found.logs if log.bank]
    if banks:
        sheet.hint(f"Bank of the road, left edge higher: {'; '.join(banks)}.")
    if found.rough:
        with sheet.folded(f"Known roughly beforehand ({len(found.rough)})"):
            sheet.hint(
                "The vehicle file is not taken to the last digit: what is held keeps its value and counts in every "
                "sigma above, the others were learned beside, from what was assumed of them."
            )
            sheet.html(tables.estimates(found.rough, history=False))


def told(sheet: Sheet, found: "Identification", outlook: "Outlook | None") -> None:
    """What the logs could tell and what they could not."""
    rows = telling.told(found, outlook)
    if not rows:
        return
    sheet.heading("told", "What the logs could and could not tell")
    said = [
        "The bar is what is left of the sigma that was assumed beforehand: short, the logs told it; full, they told "
        "nothing."
    ]
    if any(row.helps for row in rows):
        said.append(
            "What would help is reckoned at the values found, from the sensors' noise: what a change brings at best."
        )
    if any(row.noise for row in rows):
        said.append(
            "Residuals that hang together come of what the model does not have; sigma counts them. The same drive once "
            "more then brings little, another kind of drive brings more, and so does what makes the residuals whiter."
        )
    sheet.hint(" ".join(said))
    sheet.html(telling.html(rows))


def histories(sheet: Sheet, found: "Identification") -> None:
    """Every parameter over driving time."""
    sheet.heading("histories", "Histories of the parameters")
    later = " All rounds are shown; in the first, stage 1 knows no roll and is off by what that moves."
    sheet.hint(
        "What the logs had said of each parameter by then, taken together from the start on, for all unknowns at "
        "once. The band is one sigma as it would be if the model were right; the bar at the end is the table's, which "
        "also counts residuals that hang together and what the vehicle file knows only roughly."
        if found.method == "one-stage"
        else "Each parameter while the filter drives through the logs, again and again; grey vertical lines part "
        "the passes. A pass begins at the last one's value with the prior's width, and ends, in a last step, with "
        "the prior's mean put back. The band is one sigma as the filter has it; the bar at the end is the table's, "
        f"which also counts residuals that hang together.{later if found.rounds > 1 else ''}"
    )
    for title, trace in found.traces.items():
        sought = [e for e in found.parameters if e.name in trace.names]
        passes = "" if found.method == "one-stage" else f": {trace.passes} pass{'es' * (trace.passes > 1)}"
        sheet.part(f"{title.capitalize()}{passes}")
        if not sought:
            sheet.hint("No parameter of this stage was excited enough to be sought.")
            continue
        sheet.figures(
            (
                path(e.name),
                f"final {escape(with_sigma(e.value, e.sigma, e.unit))}",
                figures.history(trace, e, f"history {title}"),
            )
            for e in sought
        )
    without = [e.name for e in found.parameters if not any(e.name in t.names for t in found.traces.values())]
    if without and len(without) < len(found.parameters):
        sheet.hint(f"Not sought, so without a history: {', '.join(without)}.")


def fits(sheet: Sheet, found: "Identification") -> None:
    """Every channel of every log as measured and as the truck predicts it."""
    sheet.heading("fits", "Measured and predicted")
    sheet.hint(
        "The identified truck runs free on speed and steer angle alone. Explained: the part of the channel's variance "
        "that it gives. Noise cannot be explained; a residual about as large as the sensor's noise is as good as it "
        "gets, a slow wave in it is something that the model does not have."
    )
    for log in dict.fromkeys(fit.log for fit in found.fits):
        own = [fit for fit in found.fits if fit.log == log]
        sheet.part(log, badge="" if own[0].identified_on else "predicted only")
        sheet.figures(_fits(own))


def _fits(own: "Sequence[Fit]") -> Iterator[Row]:
    for fit in own:
        unit = facts.unit_of(fit.signal)
        share = facts.share(fit)
        caption = f"{path(fit.signal)}: {percent(max(fit.explained, 0.0), of_whole=True)} explained"
        note = f"residual {about(fit.rms, unit)} rms"
        if share.noise == share.noise:
            note += f", sensor noise about {about(share.noise, unit)}"
            note += "; no more can be explained" if share.by_noise else ""
        yield caption, escape(note), figures.fit(fit, f"log {fit.log}", unit)
