"""What truck, sensors and user state before an identification, as sentences, and the numbers that a user can state."""

from collections.abc import Mapping
from pathlib import Path

from fifthwheel.apps.app import runs
from fifthwheel.apps.app.workspace import SIGNALS, Choices, Workspace
from fifthwheel.base.formatting import enumerated
from fifthwheel.base.options import IdentifyOptions
from fifthwheel.base.settings import options_of
from fifthwheel.base.spelling import ONLY_PREDICT, question
from fifthwheel.data.channels import SignalName, error_kinds, is_sensor_error
from fifthwheel.estimate.identify import OneStage
from fifthwheel.estimate.identify.given import possible_names
from fifthwheel.estimate.identify.setup import with_tyre_law
from fifthwheel.estimate.identify.statement import GROUPS, Statement, parse
from fifthwheel.truck import Vehicle
from fifthwheel.truck.spoken_names import spoken

MANY = {**GROUPS, "*": "All numbers"}
STATEMENTS = "statements"
"""The option whose texts `stated` turns into sentences."""


def of_truck_and_sensors(workspace: Workspace, truck: Vehicle) -> list[str]:
    """What vehicle file and signal map state."""
    assumed = len(truck.assumed)
    numbers = f"{assumed} numbers are not in its file and are assumed" if assumed else "no number is assumed"
    said = [f"Truck: {truck.name}; {numbers}."]
    sensors = workspace.signal_map().sensors
    for name, sensor in sensors.items():
        kind = f"a sensor of the class {sensor.sensor_class}" if sensor.sensor_class else f"errors of {SIGNALS}"
        said.append(f"{spoken(name)}: {kind}.")
    others = "All other sensors" if sensors else "Sensors"
    return [*said, f"{others}: the usual errors and noise of their kind."]


def stated(workspace: Workspace, choices: Choices) -> dict[str, str]:
    """Sentences of what the user states of numbers, by the texts of the statements."""
    return {
        str(statement): _sentence(statement) for statement in map(parse, runs.options(workspace, choices).statements)
    }


def _sentence(statement: Statement) -> str:
    if statement.kind == "free":
        return f"{words_of(statement.name)}: unknown; only the logs determine it."
    spread = {"exact": "exact", "sigma": f"± {statement.sigma}"}.get(statement.kind, "")
    mark = ", " if statement.value and statement.kind == "exact" else " "
    return f"{words_of(statement.name)}: {mark.join(part for part in (str(statement.value), spread) if part)}."


def words_of(name: str) -> str:
    """A number, or many of them, in words.

    >>> words_of("steer.*.delay"), words_of("sensors"), words_of("tractor.mass")
    ('All sensors, steer angle delay', 'All errors of the sensors and clocks', 'Tractor, mass')
    """
    return MANY.get(name) or spoken(name).replace("*,", "All sensors,", 1)


def changed_settings(choices: Choices) -> list[str]:
    """The other settings that are not the default."""
    said = []
    for key, option in options_of(IdentifyOptions).items():
        value = choices.identify.get(key)
        if value is None or key == STATEMENTS:
            continue
        label = question(key, option)
        if isinstance(value, bool):
            said.append(f"{label}: {'yes' if value else 'no'}.")
        else:
            chosen = enumerated([str(each) for each in value]) if isinstance(value, list | tuple) else str(value)
            said.append(f"{label}: {option.choices.get(chosen, chosen)}.")
    if validate := choices.identify.get("validate"):
        said.append(f"{ONLY_PREDICT}: {enumerated([Path(name).name for name in validate])}.")
    return said


def numbers(workspace: Workspace, truck: Vehicle) -> Mapping[str, str]:
    """The numbers that a user can state: names with their words, those that are estimated first."""
    signals = workspace.signal_map().signals
    errors = [f"{signal}.{kind}" for signal in signals for kind in error_kinds(signal)]
    possible = possible_names(truck, with_tyre_law(truck, OneStage())[0])
    kinds = [f"{SignalName.of(signal).quantity}.*.{kind}" for signal in signals for kind in error_kinds(signal)]
    names = (
        *(name for name in possible if not is_sensor_error(name)),
        *truck.moved_by_wheelbase(),
        *errors,
        *kinds,
        *MANY,
    )
    return {name: f"{words_of(name)} ({name})" for name in dict.fromkeys(names)}
