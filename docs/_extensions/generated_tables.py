"""Tables of pages, from the code: each takes the place of its marker, `*Table on the site: NAME.*`."""

import ast
import inspect
import re
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import fields
from itertools import pairwise
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

from fifthwheel.apps.live.status import LiveFault, in_words
from fifthwheel.base.settings import meanings
from fifthwheel.data.channels import CHANNELS
from fifthwheel.data.logs.signal_map import SignalMap, SignalSource, TimeColumn
from fifthwheel.model.manoeuvres import MANOEUVRES
from fifthwheel.model.plant import Properties
from fifthwheel.results.assess.measures import MEASURES
from fifthwheel.results.evaluate.tolerances import DEFAULTS
from fifthwheel.truck import Axle, AxleGroup, Coupling, Payload, SprungMass, Unit
from fifthwheel.truck.classes import CLASSES
from fifthwheel.truck.driveline import Driveline
from fifthwheel.truck.unit import Accelerometer

ROOT = Path(__file__).parents[2]
MARKER = re.compile(r"^\*Table on the site: (\w+)\.\*$", re.MULTILINE)
PREFIXES = {
    Unit: "<unit>",
    SprungMass: "<unit>.sprung",
    Payload: "<unit>.payload",
    Accelerometer: "<unit>.accelerometer",
    AxleGroup: "<group>",
    Axle: "<unit>.<axle>",
    Coupling: "<coupling>",
    Driveline: "driveline",
}
SYMBOLS = {
    "<unit>.mass": "`m_i` (A1), (A4)",
    "<unit>.cog": "in `l_i,j`, `l_ic` (A2), (A5), (A7)",
    "<unit>.yaw_inertia": "`I_izz` (A2), (A5)",
    "<unit>.roll_axis_height": "`h_ir` (9), (A1)-(A7)",
    "<unit>.sprung.mass": "`m_1s`, `m_2s_e` (8), (9), (A1)",
    "<unit>.sprung.cog_height": "`h_1s`, `h_2s_e` (8), (A1)",
    "<unit>.sprung.roll_inertia": "`I_isxx` (A3), (9)",
    "<unit>.sprung.roll_yaw_product": "`I_isxz` (A2), (A3), (A5), (A6)",
    "<unit>.payload.mass": "`m_2s - m_2s_e` (8), (9)",
    "<unit>.payload.height": "`h_2p` (8), (9), (13)",
    "<unit>.payload.width": "`D_p` (9)",
    "<unit>.payload.floor_height": "`h_2f` (8), (9)",
    "<group>.cornering_stiffness": "`-C_α1f`, `-C_α1r`, `-C_α2` (7), (A1)-(A5)",
    "<group>.roll_stiffness": "`K_1f`, `K_1r`, `K_2` (A3), (A6)",
    "<group>.tyre_roll_stiffness": "`K_1tf`, `K_1tr`, `K_2t` (A3), (A6)",
    "<group>.roll_damping": "`C_1f`, `C_1r`, `C_2` (A3), (A6)",
    "<group>.relaxation_length": "ℓ",
    "<group>.pneumatic_trail": "t₀",
    "<unit>.<axle>.position": "in `l_1f`, `l_2r`, ... (A1)-(A5)",
    "<coupling>.leading_position": "in `l_1c` (A2), (A7)",
    "<coupling>.trailing_position": "in `l_2c` (A5), (A7)",
    "<coupling>.height": "`h_ic` (A7)",
    "<coupling>.roll_stiffness": "`K_12` (A3), (A6)",
}
"""Symbols and equations of the article, by the parameter."""
PRACTICAL = {"m/s": (3.6, "km/h"), "rad s^2/m": (1.0, "deg/g")}
"""Factor and unit of measures, from SI; those with a threshold only need a factor."""


def table(*rows: tuple[str, ...]) -> str:
    head, *body = ("| " + " | ".join(cell.replace("|", r"\|") for cell in row) + " |" for row in rows)
    return "\n".join([head, "|---" * len(rows[0]) + "|", *body])


def parameters() -> Iterator[tuple[str, ...]]:
    """The parameters of a vehicle with their units and symbols."""
    yield "name", "unit", "symbol", "meaning"
    for kind, prefix in PREFIXES.items():
        for name, field in kind.model_fields.items():
            if name in kind.si_units:
                path, meaning = f"{prefix}.{name}", (field.description or "").rstrip(".")
                yield f"`{path}`", kind.si_units[name], SYMBOLS.get(path, ""), meaning


def ranges() -> Iterator[tuple[str, ...]]:
    """The largest magnitudes of signals."""
    yield "quantity", "at most"
    for channel in CHANNELS.values():
        if channel.limit:
            yield f"`{channel.quantity}`", f"{channel.limit.magnitude:g} {channel.unit}".removesuffix(" 1")


def classes() -> Iterator[tuple[str, ...]]:
    """The vehicle classes."""
    yield "class", "unit"
    yield from ((f"`{name}`", kind.description) for name, kind in CLASSES.items())


def tolerances() -> Iterator[tuple[str, ...]]:
    """The default tolerances of a validation."""
    yield "name", "default"
    yield from ((f"`{name}`", value) for name, value in DEFAULTS.items())


def properties() -> Iterator[tuple[str, ...]]:
    """The properties of the nonlinear truck."""
    yield "property", "default", "meaning"
    texts, defaults = meanings(Properties), Properties()
    for field in fields(Properties):
        value = getattr(defaults, field.name)
        yield f"`{field.name}`", f"{value:g}" if isinstance(value, float) else "", texts[field.name]


def measures() -> Iterator[tuple[str, ...]]:
    """The performance-based measures with their thresholds."""
    yield "measure", "unit", "source", "threshold"
    for measure in MEASURES.values():
        factor, unit = PRACTICAL.get(measure.unit, (1.0, measure.unit.removeprefix("1")))
        numbers = [
            f"{limit.value * factor:g}{'' if limit.confirmed else ' ‡'}"
            + (f" times the {MEASURES[limit.times.removesuffix('_rear')].title} of these units" if limit.times else "")
            for limit in measure.limits
        ]
        sense = {"at least": "≥ ", "at most": "≤ "}[measure.limits[0].sense] if measure.limits else ""
        yield measure.title, unit, measure.source, sense + ", ".join(numbers)


def manoeuvres() -> Iterator[tuple[str, ...]]:
    """The manoeuvres with their forms."""
    yield "`--manoeuvre`", "linear model", "nonlinear truck", "description"
    for name, m in MANOEUVRES.items():
        steered = "open loop" if m.open_loop else ""
        yield f"`{name}`", "acceleration" if m.acceleration else steered, "path" if m.path else steered, m.description


def live_faults() -> Iterator[tuple[str, ...]]:
    """The faults of the live node."""
    yield "", "fault", "meaning"
    texts = attribute_texts(LiveFault)
    yield from ((str(fault.value), in_words(fault.name or ""), texts[fault.name or ""]) for fault in LiveFault)


def layers() -> Iterator[tuple[str, ...]]:
    """The packages in the order of their layers, with the first sentence of their documentation."""
    yield "place", "what it has"
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    inside = {c["containers"][0]: c["layers"] for c in contracts if c["type"] == "layers"}
    source = ROOT / "src" / "fifthwheel"
    for layer in reversed(inside["fifthwheel"][1:]):
        yield f"`{layer}`", summary(source / layer)
        ordered = [name.strip() for row in reversed(inside.get(f"fifthwheel.{layer}", [])) for name in row.split("|")]
        found = sorted(path.stem for path in (source / layer).iterdir() if path.name[:1] not in "_.")
        for name in [*ordered, *(name for name in found if name not in ordered and layer != "truck")]:
            yield f"`{layer}/{name}`", summary(source / layer / name)


def keys() -> Iterator[tuple[str, ...]]:
    """The keys of a signal map."""
    yield "table", "key", "meaning"
    texts = attribute_texts(SignalMap)
    yield "`ignore`, a list", "", texts["ignore"]
    yield "`databases`, a list", "", texts["databases"]
    for i, (key, text) in enumerate(attribute_texts(TimeColumn).items()):
        yield "" if i else "`[time]`", f"`{key}`", text
    yield "`[signals]`", '`<name> = "column"`', "Short form of a table with `column` only."
    for i, (key, text) in enumerate(attribute_texts(SignalSource).items()):
        yield "" if i else '`[signals."<name>"]`', f"`{key}`", text
    yield '`[reference]`, `[reference."<name>"]`', "the same", "For comparison only."


def attribute_texts(kind: type) -> dict[str, str]:
    """The text below each public field of a class."""
    (tree,) = ast.parse(inspect.getsource(kind)).body
    found = {}
    for statement, text in pairwise(getattr(tree, "body", ())):
        match statement, text:
            case (
                ast.AnnAssign(target=ast.Name(id=name)) | ast.Assign(targets=[ast.Name(id=name)]),
                ast.Expr(value=ast.Constant(value=str(sentences))),
            ):
                if name[0] != "_":
                    found[name] = " ".join(sentences.split())
    return found


def summary(path: Path) -> str:
    """The first paragraph of the documentation of a module or package."""
    file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    return " ".join(text.partition("\n\n")[0].split())


TABLES: dict[str, Callable[[], Iterator[tuple[str, ...]]]] = {
    "parameters": parameters,
    "ranges": ranges,
    "classes": classes,
    "tolerances": tolerances,
    "properties": properties,
    "layers": layers,
    "keys": keys,
    "measures": measures,
    "manoeuvres": manoeuvres,
    "live_faults": live_faults,
}


def with_tables(text: str) -> str:
    """The text of a page with its tables."""
    return MARKER.sub(lambda marker: table(*TABLES[marker[1]]()), text)


def add_tables(app: Sphinx, document: str, source: list[str]) -> None:
    source[0] = with_tables(source[0])


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("source-read", add_tables)
    return {"parallel_read_safe": True}
