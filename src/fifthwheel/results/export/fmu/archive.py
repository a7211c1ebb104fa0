"""The file of an FMU: description, sources, libraries and documentation."""

import zipfile
from collections.abc import Iterable, Sequence
from importlib import resources
from pathlib import Path

from fifthwheel.base import pages
from fifthwheel.base.atomic import atomic_write
from fifthwheel.base.errors import FifthwheelError, suggestion
from fifthwheel.base.pages.html import page
from fifthwheel.estimate.observe import Observer
from fifthwheel.results.export.fmu import description
from fifthwheel.results.export.fmu.binaries import PLATFORMS, libraries
from fifthwheel.results.export.fmu.observer import observer_model
from fifthwheel.results.export.fmu.truck import truck_model
from fifthwheel.results.export.fmu.variables import FmuModel, Role
from fifthwheel.results.export.fmu.variables import table as variable_table
from fifthwheel.truck import Vehicle

_COMMON = ("fmu.h", "fmu.c", "fmu_export.h")
_DATE = (1980, 1, 1, 0, 0, 0)
"""Of all files in the archive: equal models give equal files."""


def export_fmu(
    subject: Observer | Vehicle,
    path: str | Path,
    *,
    fmi: int = 3,
    outputs: Sequence[str] | None = None,
    tunable: Sequence[str] | None = None,
    platforms: Iterable[str] = tuple(PLATFORMS),
) -> Path:
    """Write an observer, or the linear model of a vehicle, as a functional mock-up unit for co-simulation.

    Args:
        subject: an observer, whose present state is not exported, or a vehicle.
        path: of the file, by convention with the ending .fmu.
        fmi: version of the standard, 2 or 3.
        outputs: of a vehicle: names of its outputs; by default every quantity of every unit that a sensor could
            measure.
        tunable: of a vehicle: parameters that the importer can change, by path or by the end of it; by default those
            that one stage estimates.
        platforms: for which the FMU has a library: "x86_64-linux", "x86_64-windows"; none for sources only.

    Returns:
        The path.

    Raises:
        SignalError: the model does not have an output.
        VehicleError: a parameter does not exist, or no axle is steerable.
        FifthwheelError: another version or platform, ziglang is not installed, or an observer has outputs or tunable
            parameters.

    Example:
        >>> import tempfile
        >>> import fifthwheel as fw
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     fw.export_fmu(fw.vehicle("cheng_cebon_2011"), f"{folder}/truck.fmu", platforms=[]).name
        'truck.fmu'
    """
    if fmi not in (2, 3):
        raise FifthwheelError(f"fmi: expected 2 or 3, got {fmi!r}; these versions of the standard can be written")
    platforms = tuple(platforms)
    for name in platforms:
        if name not in PLATFORMS:
            raise FifthwheelError(f"{name}: no platform of an FMU; {suggestion(name, PLATFORMS)}")
    if isinstance(subject, Observer):
        if outputs is not None or tunable is not None:
            raise FifthwheelError("outputs, tunable: an observer has its own outputs, and no parameters; omit them")
        model, kind = observer_model(subject), "observer"
    else:
        model, kind = truck_model(subject, outputs=outputs, tunable=tunable), "truck"
    given = resources.files("fifthwheel.results.export.fmu") / "c"
    names = (*_COMMON, f"fmi{fmi}.h", f"fmi{fmi}.c", f"fmu_{kind}.c")
    sources = {name: (given / name).read_text(encoding="utf-8") for name in names}
    sources |= model.sources | {"fmu_variables.c": variable_table(model.variables)}
    identity = description.token({**sources, "fmu_model.h": model.header})
    sources["fmu_model.h"] = _header(model, identity)
    to_compile = [name for name in sources if name.endswith(".c")]
    content: dict[str, str | bytes] = {
        "modelDescription.xml": description.model_description(model, fmi, identity, to_compile),
        "documentation/index.html": _documentation(model),
        "documentation/licenses/license.txt": (given / "license.txt").read_text(encoding="utf-8"),
        **{f"sources/{name}": text for name, text in sources.items()},
    }
    if fmi == 3:
        content["sources/buildDescription.xml"] = description.build_description(model, to_compile)
    if platforms:
        for name, library in libraries(sources, model.identifier, platforms).items():
            platform = PLATFORMS[name]
            folder = name if fmi == 3 else platform.fmi2
            content[f"binaries/{folder}/{model.identifier}{platform.suffix}"] = library
    path = Path(path)
    with atomic_write(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in content.items():
            entry = zipfile.ZipInfo(name, _DATE)
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            archive.writestr(entry, data)
    return path


def _header(model: FmuModel, identity: str) -> str:
    return f"""/* Sizes and the state of this model, generated; included by fmu.h only. */

#ifndef FMU_MODEL_H
#define FMU_MODEL_H

#define FMU_TOKEN "{identity}"
#define FMU_COUNT {len(model.variables)}
{model.header}

extern const fmu_variable fmu_variables[FMU_COUNT];

#endif
"""


def _documentation(model: FmuModel) -> bytes:
    """The page to which an importer links."""
    rows = [
        [variable.name, description.VARIABILITY[variable.role][0], variable.unit or "", variable.description]
        for variable in model.variables
        if variable.role is not Role.TIME
    ]
    axes = "All numbers are in SI; axes are those of ISO 8855 (x forward, y left, z up)."
    table = pages.Table(("variable", "role", "unit", "content"), rows)
    content, _ = page(pages.Document(model.description, [pages.Items(model.notes), pages.Paragraph(axes), table]))
    return content
