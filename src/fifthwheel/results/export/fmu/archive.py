"""The file of an FMU: XML files by the schemas of FMI 2.0 and 3.0, sources, libraries and documentation.

The libraries are compiled by zig from the package ziglang, which has compilers for every platform. They need no C
library: `freestanding` declares the few functions, and their code comes from the run-time library of the compiler. So
a library runs with every version of the C library, and that of the target does not have to be compiled first, which
takes minutes.
"""

import hashlib
import os
import shutil
import subprocess
import sys
import uuid
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from importlib import resources
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple
from xml.etree import ElementTree as ET

from fifthwheel import __version__
from fifthwheel.base import pages
from fifthwheel.base.atomic import atomic_write, cleaned_up
from fifthwheel.base.errors import FifthwheelError, suggestion
from fifthwheel.base.formatting import plain_ascii, shown
from fifthwheel.base.lazy import require
from fifthwheel.base.pages.html import page
from fifthwheel.base.units import base_units
from fifthwheel.estimate.observe import Observer
from fifthwheel.results.export.fmu.models import FmuModel, Role, Variable, observer_model, truck_model, variable_table
from fifthwheel.truck import Vehicle

_OPTIONS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-fvisibility=hidden", "-shared", "-s")
_WITHOUT_C_LIBRARY = ("-nostdlib", "-rtlib=compiler-rt", "-Ifreestanding")
VARIABILITY = {
    Role.TIME: ("independent", "continuous"),
    Role.INPUT: ("input", "continuous"),
    Role.FIXED: ("parameter", "fixed"),
    Role.TUNABLE: ("parameter", "tunable"),
    Role.OUTPUT: ("output", "continuous"),
    Role.INTEGER_OUTPUT: ("output", "discrete"),
}
"""Causality and variability by role."""
_COMMON = ("fmu.h", "fmu.c", "fmi.h")
_DATE = (1980, 1, 1, 0, 0, 0)
"""Of all files in the archive: equal models give equal files."""


class Platform(NamedTuple):
    """A platform for which FMUs are compiled."""

    target: str  # of zig
    fmi2: str  # folder of the library in an FMU of FMI 2.0
    suffix: str
    extra: tuple[str, ...]  # more arguments of the compiler


PLATFORMS = {
    "x86_64-linux": Platform("x86_64-linux-gnu", "linux64", ".so", ()),
    "x86_64-windows": Platform("x86_64-windows-gnu", "win64", ".dll", ("windows.c", "-lkernel32")),
}
"""Platforms by their names in FMI 3.0."""


def libraries(sources: Mapping[str, str], identifier: str, platforms: Iterable[str]) -> dict[str, bytes]:
    """The shared library of each of some `PLATFORMS`, of C files and headers by name.

    The cache of the compiler is temporary, unless its variable ZIG_GLOBAL_CACHE_DIR names another one.

    Raises:
        FifthwheelError: ziglang is not installed, or the compiler fails.
    """
    require("ziglang", "fmu")
    with (
        TemporaryDirectory(prefix="fifthwheel-", ignore_cleanup_errors=True) as name,
        cleaned_up(lambda: shutil.rmtree(name, ignore_errors=True)),
    ):
        folder = Path(name)
        for file, text in sources.items():
            (folder / file).write_text(text, encoding="utf-8")
        (folder / "freestanding").mkdir()
        for given in (resources.files("fifthwheel.results.export.fmu") / "freestanding").iterdir():
            place = folder if given.name.endswith(".c") else folder / "freestanding"
            (place / given.name).write_bytes(given.read_bytes())
        return {platform: _library(folder, sources, identifier, PLATFORMS[platform]) for platform in platforms}


def _library(folder: Path, sources: Iterable[str], identifier: str, platform: Platform) -> bytes:
    result = folder / f"{identifier}{platform.suffix}"
    files = [name for name in sources if name.endswith(".c")]
    command = [sys.executable, "-m", "ziglang", "cc", "-target", platform.target, *_OPTIONS, *_WITHOUT_C_LIBRARY]
    cache = str(folder / "cache")
    done = subprocess.run(
        [*command, *files, "atan.c", *platform.extra, "-o", result.name],
        cwd=folder,
        env={"ZIG_GLOBAL_CACHE_DIR": cache, "ZIG_LOCAL_CACHE_DIR": cache} | os.environ,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode or not result.is_file():
        raise FifthwheelError(f"{platform.target}: the compiler failed; install ziglang again: {done.stderr[-1000:]}")
    return result.read_bytes()


def token(sources: Mapping[str, str]) -> str:
    """Identifies the sources of an FMU, so that description and library belong together."""
    digest = hashlib.sha256("\0".join(f"{name}\0{text}" for name, text in sorted(sources.items())).encode())
    return f"{{{uuid.UUID(digest.hexdigest()[:32])}}}"


def model_description(model: FmuModel, fmi: int, identity: str, source_files: Iterable[str]) -> str:
    """modelDescription.xml of FMI 2 or 3, with an identity from `token` and the names of the C files to compile."""
    root = ET.Element(
        "fmiModelDescription",
        {
            "fmiVersion": f"{fmi}.0",
            "modelName": model.name,
            {2: "guid", 3: "instantiationToken"}[fmi]: identity,
            "description": model.description,
            "license": "BSD-3-Clause; see documentation/licenses",
            "generationTool": f"fifthwheel {__version__}",
            "variableNamingConvention": "flat",
        },
    )
    root.append(_co_simulation(model, fmi, source_files))
    root.append(_units(model.variables))
    categories = ET.SubElement(root, "LogCategories")
    ET.SubElement(categories, "Category", {"name": "logStatusError", "description": "errors, with their cure"})
    ET.SubElement(root, "DefaultExperiment", {"startTime": "0.0", "stopTime": "10.0", "stepSize": repr(model.step)})
    variables = ET.SubElement(root, "ModelVariables")
    for reference, variable in enumerate(model.variables):
        variables.append(_variable(variable, reference, fmi))
    root.append(_structure(model.variables, fmi))
    return _text(root)


def build_description(model: FmuModel, source_files: Iterable[str]) -> str:
    """sources/buildDescription.xml of FMI 3.0."""
    root = ET.Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    configuration = ET.SubElement(root, "BuildConfiguration", {"modelIdentifier": model.identifier})
    files = ET.SubElement(configuration, "SourceFileSet", {"language": "C99"})
    for name in source_files:
        ET.SubElement(files, "SourceFile", {"name": name})
    return _text(root)


def _co_simulation(model: FmuModel, fmi: int, source_files: Iterable[str]) -> ET.Element:
    state = {2: "FMUstate", 3: "FMUState"}[fmi]
    element = ET.Element(
        "CoSimulation",
        {
            "modelIdentifier": model.identifier,
            "canHandleVariableCommunicationStepSize": "true",
            "canBeInstantiatedOnlyOncePerProcess": "false",
            f"canGetAndSet{state}": "true",
            f"canSerialize{state}": "true",
        },
    )
    if fmi == 2:
        element.set("canInterpolateInputs", str(model.interpolates).lower())
        element.set("canNotUseMemoryManagementFunctions", "true")
        files = ET.SubElement(element, "SourceFiles")
        for name in source_files:
            ET.SubElement(files, "File", {"name": name})
    return element


def _units(variables: Iterable[Variable]) -> ET.Element:
    element = ET.Element("UnitDefinitions")
    for name in sorted({variable.unit for variable in variables if variable.unit}):
        unit = ET.SubElement(element, "Unit", {"name": name})
        ET.SubElement(unit, "BaseUnit", {base: str(power) for base, power in base_units(name).items()})
        if display := _display_unit(name):
            ET.SubElement(unit, "DisplayUnit", {"name": display, "factor": repr(shown(name).factor)})
    return element


def _display_unit(unit: str) -> str | None:
    """The unit in which an importer shows a quantity, if it is not the SI unit."""
    return plain_ascii(shown(unit).name) if shown(unit).factor != 1 and unit != "s" else None


def _numeric(variable: Variable) -> dict[str, str]:
    """Attributes of the type of a variable."""
    attributes: dict[str, str] = {}
    if variable.unit:
        attributes["unit"] = variable.unit
        if display := _display_unit(variable.unit):
            attributes["displayUnit"] = display
    if variable.limits:
        attributes |= {"min": repr(variable.limits[0]), "max": repr(variable.limits[1])}
    is_set = variable.role in (Role.INPUT, Role.FIXED, Role.TUNABLE)
    return attributes | ({"start": repr(variable.start)} if is_set else {})


def _variable(variable: Variable, reference: int, fmi: int) -> ET.Element:
    causality, variability = VARIABILITY[variable.role]
    common = {
        "name": variable.name,
        "valueReference": str(reference),
        "description": variable.description,
        "causality": causality,
        "variability": variability,
    }
    is_integer = variable.role is Role.INTEGER_OUTPUT
    if fmi == 3:
        return ET.Element("Int32" if is_integer else "Float64", common | _numeric(variable))
    element = ET.Element("ScalarVariable", common)
    ET.SubElement(element, "Integer" if is_integer else "Real", _numeric(variable))
    return element


def _structure(variables: Iterable[Variable], fmi: int) -> ET.Element:
    """Outputs are computed in a step, so they do not depend on the inputs that are set after it."""
    element = ET.Element("ModelStructure")
    outputs = [i for i, variable in enumerate(variables) if variable.role in (Role.OUTPUT, Role.INTEGER_OUTPUT)]
    for kind, attributes in (("Output", {"dependencies": ""}), ("InitialUnknown", {})):
        group = element if fmi == 3 else ET.SubElement(element, f"{kind}s")
        for i in outputs:
            place = {"valueReference": str(i)} if fmi == 3 else {"index": str(i + 1)}
            ET.SubElement(group, kind if fmi == 3 else "Unknown", place | attributes)
    return element


def _text(root: ET.Element) -> str:
    ET.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(root, encoding="unicode")}\n'


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
    identity = token({**sources, "fmu_model.h": model.header})
    sources["fmu_model.h"] = _header(model, identity)
    to_compile = [name for name in sources if name.endswith(".c")]
    content: dict[str, str | bytes] = {
        "modelDescription.xml": model_description(model, fmi, identity, to_compile),
        "documentation/index.html": _documentation(model),
        "documentation/licenses/license.txt": (given / "license.txt").read_text(encoding="utf-8"),
        **{f"sources/{name}": text for name, text in sources.items()},
    }
    if fmi == 3:
        content["sources/buildDescription.xml"] = build_description(model, to_compile)
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
        [variable.name, VARIABILITY[variable.role][0], variable.unit or "", variable.description]
        for variable in model.variables
        if variable.role is not Role.TIME
    ]
    axes = "All numbers are in SI; axes are those of ISO 8855 (x forward, y left, z up)."
    table = pages.Table(("variable", "role", "unit", "content"), rows)
    content, _ = page(pages.Document(model.description, [pages.Items(model.notes), pages.Paragraph(axes), table]))
    return content
