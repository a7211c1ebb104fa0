"""The folder of a C library."""

from importlib import resources
from pathlib import Path

from fifthwheel import __version__
from fifthwheel._atomic import atomic_write
from fifthwheel.export import observer_model
from fifthwheel.observe import Observer

FILES = ("README.md", "CMakeLists.txt", "fw_observer.h", "fw_observer.c", "fw_model.h", "replay.c")
"""The files of an exported observer."""


def export_c(observer: Observer, folder: str | Path) -> list[Path]:
    """Write an observer as a library in C99, with its build file and a test program.

    Args:
        observer: with vehicle, signals and settings; its present state is not exported.
        folder: for `FILES`; made if it does not exist.

    Returns:
        The files.

    Raises:
        FifthwheelError: two signals have the same name in C.

    Example:
        >>> import tempfile
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> observer = fw.Observer(truck, ["speed", "steer.tractor.front", "yaw_rate.tractor", "yaw_rate.semitrailer"])
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     [path.name for path in fw.export_c(observer, folder)]
        ['README.md', 'CMakeLists.txt', 'fw_observer.h', 'fw_observer.c', 'fw_model.h', 'replay.c']
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts(observer).items():
        with atomic_write(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return [folder / name for name in FILES]


def texts(observer: Observer) -> dict[str, str]:
    """The content of each of `FILES`.

    Raises:
        FifthwheelError: two signals have the same name in C.
    """
    numbers = 2 + 3 * len(observer.inputs) + observer.scan.n_carry
    names = {
        "TITLE": "".join(c for c in observer.vehicle.name if c.isalnum() or c in " -_.,()"),
        "VERSION": __version__,
        "COLUMNS": ", ".join((*observer.inputs, *observer.outputs)),
        "BYTES": str(8 * numbers + 8),
        "ENUMERATIONS": observer_model.header(observer),
        "MODEL": observer_model.source(observer),
    }
    sources, result = resources.files("fifthwheel.export") / "c", {}
    for name in FILES:
        given = sources / name
        if given.is_file():
            result[name] = given.read_text(encoding="utf-8")
        else:
            result[name] = (sources / f"{name}.in").read_text(encoding="utf-8")
            for key, value in names.items():
                result[name] = result[name].replace(f"@{key}@", value)
    return result
