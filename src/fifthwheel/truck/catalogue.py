"""Vehicles with published numbers; the comments of each file give the origin of every value."""

from functools import lru_cache
from importlib.resources import files

from fifthwheel.base.errors import VehicleError, suggestion
from fifthwheel.truck.vehicle import Vehicle


def names() -> tuple[str, ...]:
    """Names of all vehicles in the catalogue, sorted."""
    folder = files(__package__) / "catalogue"
    return tuple(sorted(file.name.removesuffix(".toml") for file in folder.iterdir() if file.name.endswith(".toml")))


def get(name: str) -> Vehicle:
    """A vehicle of the catalogue.

    Raises:
        VehicleError: the catalogue has no vehicle of that name.

    Example:
        >>> import fifthwheel as fw
        >>> fw.vehicle("cheng_cebon_2011")
        Vehicle('cheng_cebon_2011', tractor + semitrailer, 40.6 t)
    """
    return Vehicle.loads(text(name))


@lru_cache
def text(name: str) -> str:
    """The TOML file of a vehicle with its comments, a template for other vehicles; errors as in `get`."""
    if name not in names():
        file = "; fw.Vehicle.load reads a file" if str(name).endswith(".toml") else ""
        raise VehicleError(f"{name}: no such vehicle in the catalogue; {suggestion(str(name), names())}{file}")
    return (files(__package__) / "catalogue" / f"{name}.toml").read_text(encoding="utf-8")
