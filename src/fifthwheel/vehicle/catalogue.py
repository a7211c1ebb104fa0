"""Trucks whose numbers are published; each file says value by value what is published and what was chosen."""

from functools import lru_cache
from importlib.resources import files

from fifthwheel.errors import VehicleError
from fifthwheel.vehicle.files import loads
from fifthwheel.vehicle.part import suggestion
from fifthwheel.vehicle.vehicle import Vehicle


def names() -> tuple[str, ...]:
    """Names of all vehicles in the catalogue."""
    here = files(__package__) / "catalogue"
    return tuple(sorted(file.name.removesuffix(".toml") for file in here.iterdir() if file.name.endswith(".toml")))


def get(name: str) -> Vehicle:
    """A vehicle of the catalogue."""
    return loads(text(name))


@lru_cache
def text(name: str) -> str:
    """Its file, with the comments that tell the origin of each value; a start for one's own."""
    if name not in names():
        raise VehicleError(f"{name}: no such vehicle in the catalogue; {suggestion(name, names())}")
    return (files(__package__) / "catalogue" / f"{name}.toml").read_text(encoding="utf-8")
