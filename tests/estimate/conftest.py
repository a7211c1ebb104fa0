"""A truck with known parameters, and the same truck with wrong initial values."""

import pytest

from fifthwheel import truck as vehicle
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify.unknowns.parameters import stage_1_names
from fifthwheel.truck import Vehicle


@pytest.fixture(scope="session")
def truck() -> Vehicle:
    return vehicle.get("cheng_cebon_2011")


@pytest.fixture(scope="session")
def guess(truck: Vehicle) -> Vehicle:
    """80 and 120 % of the parameters of stage 1."""
    values = truck.parameters()
    names = stage_1_names(truck)
    return truck.replace({name: values[name] * f for name, f in zip(names, (0.8, 1.2, 0.8, 1.2), strict=True)})


def without(record: Record, *quantities: str) -> Record:
    """The record without the signals of some quantities."""
    kept = {name: values for name, values in record.signals.items() if name.split(".")[0] not in quantities}
    return Record(time=record.time, signals=kept, name=record.name)
