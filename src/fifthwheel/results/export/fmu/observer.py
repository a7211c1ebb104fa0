"""The observer of a vehicle as the model of an FMU."""

from fifthwheel.estimate.observe import Observer, Status
from fifthwheel.results.export import project
from fifthwheel.results.export.fmu.variables import TIME, FmuModel, Role, Variable, of_signal

MEASURED = "measured."
"""Prefix of the inputs that are also estimated, such as yaw rates."""
SAMPLE_TIME = 0.01
"""s; default of the parameter."""
SAMPLE_TIMES = (0.0, 10.0)
"""Limits of the parameter, s."""


def observer_model(observer: Observer) -> FmuModel:
    """Inputs are the signals of the observer, outputs its states, each with its sigma, nis and status."""
    inputs = [of_signal(name, Role.INPUT, "measured") for name in observer.inputs]
    inputs += [of_signal(name, Role.INPUT, "measured", f"{MEASURED}{name}") for name in observer.outputs]
    words = "least time from one sample to the next; 0: each step is a sample"
    sample_time = Variable(
        name="sample_time", role=Role.FIXED, unit="s", start=SAMPLE_TIME, limits=SAMPLE_TIMES, description=words
    )
    outputs = []
    for name in observer.reported:
        outputs.append(of_signal(name, Role.OUTPUT, "estimated"))
        outputs.append(of_signal(name, Role.OUTPUT, "standard deviation of the estimated", f"{name}.sigma"))
    nis = Variable(
        name="nis", role=Role.OUTPUT, unit="1", description="mean normalised innovation squared; 1 is expected"
    )
    words = ", ".join(f"{status.value} {status.name.lower().replace('_', ' ')}" for status in Status)
    status = Variable(name="status", role=Role.INTEGER_OUTPUT, unit=None, description=f"status: {words}")
    variables = (TIME, *inputs, sample_time, *outputs, nis, status)
    place = {variable.name: i for i, variable in enumerate(variables)}
    numbers = {
        "FMU_FIRST_INPUT": 1,
        "FMU_SAMPLE_TIME": place["sample_time"],
        "FMU_FIRST_OUTPUT": place[outputs[0].name],
        "FMU_NIS": place["nis"],
        "FMU_STATUS": place["status"],
    }
    library = project.observer_texts(observer)
    return FmuModel(
        name=f"{observer.vehicle.name} observer",
        description=f"State observer of {observer.vehicle.name}",
        variables=variables,
        interpolates=False,
        step=SAMPLE_TIME,
        header="\n".join(
            [
                '#include "fw_observer.h"',
                "",
                *(f"#define {name} {value}" for name, value in numbers.items()),
                "",
                "typedef struct {",
                "    fw_observer observer;",
                "    double sampled; /* s, time of the last sample */",
                "} fmu_model;",
            ]
        ),
        sources={name: library[name] for name in library if name.startswith("fw_")},
        notes=(
            "A step takes the inputs at its start as one sample, if sample_time has passed since the last one, and "
            "gives the states of that sample. Set sample_time to the sampling period of the sensors; steps may have "
            "any length.",
            "An input that is not a number, or that no heavy vehicle reaches, such as 1e9, is missing in this sample.",
            "Before the first sample, and if status is 2 or 3, the states are not numbers (NaN).",
        ),
    )
