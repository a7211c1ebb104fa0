"""The XML files of an FMU, by the schemas of FMI 2.0 and 3.0."""

import hashlib
import uuid
from collections.abc import Iterable, Mapping
from xml.etree import ElementTree as ET

from fifthwheel import __version__
from fifthwheel.base.formatting import plain_ascii, shown
from fifthwheel.base.units import base_units
from fifthwheel.results.export.fmu.variables import FmuModel, Role, Variable

VARIABILITY = {
    Role.TIME: ("independent", "continuous"),
    Role.INPUT: ("input", "continuous"),
    Role.FIXED: ("parameter", "fixed"),
    Role.TUNABLE: ("parameter", "tunable"),
    Role.OUTPUT: ("output", "continuous"),
    Role.INTEGER_OUTPUT: ("output", "discrete"),
}
"""Causality and variability by role."""


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
