"""The tables of settings, from the fields and the sentence that documents each; and those of default priors."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import Any

from sphinx.application import Sphinx

import fifthwheel as fw
from fifthwheel.base.settings import Settings, meanings, shown
from fifthwheel.data.channels import PLACE_KINDS, SensorErrorName, channels_with_errors
from fifthwheel.estimate.design import DesignSettings
from fifthwheel.estimate.filters.relinearised import RelinearisationSettings
from fifthwheel.estimate.identify.unknowns.parameters import reported_parameters
from fifthwheel.truck.quantities import QUANTITIES, quantity_of

LONG = 60
"""A default with more characters stands below its table."""


def reference() -> Iterator[str]:
    """Markdown of all settings."""
    yield from chapter("OneStage", fw.OneStage())
    yield from chapter("LearnerSettings", fw.LearnerSettings())
    yield from chapter("RelinearisationSettings", RelinearisationSettings())
    yield from chapter("TwoStage", fw.TwoStage(), article=fw.article())
    yield from chapter("ObserverSettings", fw.ObserverSettings())
    yield from chapter("DesignSettings", DesignSettings())
    yield from priors()
    yield from sensor_errors()


def chapter(title: str, settings: Settings, **presets: Settings) -> Iterator[str]:
    """A heading and the table of one class; a preset has a column with the values that it changes."""
    texts = meanings(type(settings))
    yield f"## {title}\n\n| field | default | {''.join(f'`{name}()` | ' for name in presets)}meaning |"
    yield f"|---|---|{'---|' * len(presets)}---|"
    below = []
    for field in fields(settings):
        value = getattr(settings, field.name)
        changed = [getattr(preset, field.name) for preset in presets.values()]
        cells = [f"`{field.name}`", f"`{shown(value)}`", *("" if v == value else f"`{shown(v)}`" for v in changed)]
        if isinstance(value, Mapping) and len(repr(value)) > LONG:
            cells[1] = "below"
            below.append(f"\n`{field.name}`:\n\n```python\n{lines(value)}\n```")
        yield "| " + " | ".join([*cells, texts[field.name].replace("|", r"\|")]) + " |"
    yield "\n".join(below) + "\n"


def priors() -> Iterator[str]:
    """The default priors of numbers of the truck, the road and the model; of parameters of a result, as a guess."""
    truck, separate = fw.vehicle("cheng_cebon_2011"), fw.OneStage(uniform_payload=False)
    reported = [*reported_parameters(truck, fw.OneStage()), *reported_parameters(truck, separate)]
    yield "## Priors\n\n| end of the name | prior | as a parameter of the result | based on |\n|---|---|---|---|"
    for name, row in QUANTITIES.items():
        unit = row.unit if row.absolute else ""
        known = prior(row.mean, row.sigma, unit) if row.sigma else ""
        is_guess = row.mean is None and any(quantity_of(path) is row for path in reported)
        guess = prior(None, row.guess, "") if is_guess else ""
        if known or guess:
            yield f"| `{name}` | {known} | {guess} | {row.source} |"
    yield ""


def sensor_errors() -> Iterator[str]:
    """The default priors of the errors of sensors."""
    yield "## Sensor errors\n\n| name | prior | of |\n|---|---|---|"
    for channel in channels_with_errors():
        sensors = channel.quantity if channel.of == "vehicle" else f"{channel.quantity}.*"
        for error in channel.errors:
            mean = None if error.kind in PLACE_KINDS else float(error.kind == "gain")
            unit = SensorErrorName(channel.quantity, error.kind).unit or ""
            whose = "each log" if error.per_log else "the truck"
            yield f"| `{sensors}.{error.kind}` | {prior(mean, error.prior, unit)} | {whose} |"
    yield ""


def prior(mean: float | None, sigma: float, unit: str) -> str:
    """Mean, if it is not that of the vehicle, and standard deviation; a fraction of the value if the unit is empty."""
    centre = "" if mean is None else f"{mean:g} "
    if not unit:
        return f"{centre}± {100 * sigma:g} %"
    angle = f" ({math.degrees(sigma):.2g} deg)" if unit == "rad" else ""
    return f"{centre}± {sigma:.3g}{'' if unit == '1' else f' {unit}'}{angle}"


def lines(value: Mapping[str, Any]) -> str:
    return "{\n" + "".join(f"    {key!r}: {item!r},\n" for key, item in value.items()) + "}"


def add_reference(app: Sphinx, document: str, source: list[str]) -> None:
    if document == "settings":
        source[0] += "\n" + "\n".join(reference())


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("source-read", add_reference)
    return {"parallel_read_safe": True}
