"""fifthwheel export"""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from fifthwheel.apps.cli import common
from fifthwheel.apps.cli.app import command, export_app
from fifthwheel.base.atomic import reserved, result_folder
from fifthwheel.base.options import ObserverOptions
from fifthwheel.base.settings import arguments

if TYPE_CHECKING:
    from fifthwheel.estimate.identify import Identification
    from fifthwheel.estimate.observe import Observer
    from fifthwheel.estimate.online import Learner
    from fifthwheel.truck import Vehicle

IDENTIFICATION = "An identification.json: sensor errors and noise that all its logs share"
MEASURED = (
    "Default: those of the identification, or speed, the steer angles that the vehicle file says, yaw rate and roll "
    "rate of every unit."
)


@command(
    "fifthwheel export c --vehicle result",
    "fifthwheel export c -v truck.toml --signal speed --signal steer.tractor.front --signal yaw_rate.tractor",
    "fifthwheel export c -v truck.toml --bank --out observer",
    "fifthwheel export c -v truck.toml --learner --passes 0 --out learner",
    of=export_app,
)
def c(
    vehicle: common.VehicleOption,
    identification: Annotated[
        Path | None,
        typer.Option(
            "--identification", "-i", help=f"{IDENTIFICATION}; of a learner, the settings. {common.OF_RESULT}"
        ),
    ] = None,
    signal: Annotated[
        list[str] | None,
        typer.Option("--signal", help=f"A signal that the control unit has; may be repeated. {MEASURED}"),
    ] = None,
    *,
    chosen: ObserverOptions,
    learner: Annotated[
        bool, typer.Option("--learner", help="Write the learner, which also estimates the parameters of the vehicle.")
    ] = False,
    passes: Annotated[
        int | None,
        typer.Option(min=0, help="Of a learner: passes over a segment with excitation; 0 saves memory."),
    ] = None,
    segment: Annotated[
        int | None, typer.Option(min=1, help="Of a learner: samples of such a segment; they stay in memory.")
    ] = None,
    out: common.OutOption = Path("fifthwheel-c"),
    force: common.ForceOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """Write the state observer of a vehicle, or its learner, as a library in C99 with a build file and a test program.

    The library needs no heap and, of the C library, only sqrt, fabs, exp and ceil (with tyres that saturate also sin,
    cos and atan); it computes in double or, with -DFW_FLOAT, in single precision. It treats missing samples, gaps and
    wrong measurements like `fifthwheel states`; a learner does what `Learner` does in Python.
    """
    from fifthwheel.apps.workflow.runs import exported_learner, exported_observer
    from fifthwheel.base.errors import FifthwheelError
    from fifthwheel.results.export import FILES, LEARNER_FILES, export_c

    if learner and chosen.estimate_bank:
        raise FifthwheelError("--bank: a learner always has the bank of the road as a state; omit --bank")
    if learner and (refused := _of_an_observer(chosen)):
        raise FifthwheelError(f"{', '.join(refused)}: only for an observer; omit it, or --learner")
    if not learner and (passes is not None or segment is not None):
        raise FifthwheelError("--passes, --segment: settings of a learner; add --learner, or omit them")
    truck, stored, read = _known(vehicle, identification)
    estimator: Observer | Learner
    if learner:
        estimator = exported_learner(truck, signal, stored, min_speed=chosen.min_speed, passes=passes, segment=segment)
        setup = estimator.live.setup
        estimated = tuple(unknown.name for unknown in setup.estimated_unknowns)
        described = {"inputs": setup.inputs, "measured": setup.outputs, "estimated": estimated}
    else:
        estimator = exported_observer(truck, signal, stored, chosen)
        described = {"inputs": estimator.inputs, "measured": estimator.outputs, "states": estimator.reported}
    names = LEARNER_FILES if learner else FILES
    with result_folder(out, "export c", names, inputs=read, force=force) as folder:
        files = common.in_folder(out, [path.name for path in export_c(estimator, folder)])
    common.print_result(described, None, files, as_json=as_json)


@command(
    "fifthwheel export fmu --vehicle result/vehicle.toml --what truck",
    "fifthwheel export fmu -v result --what observer --out observer.fmu",
    "fifthwheel export fmu -v truck.toml --what truck --fmi 2 --signal yaw_rate.tractor --tunable cornering_stiffness",
    of=export_app,
)
def fmu(
    vehicle: common.VehicleOption,
    what: Annotated[
        Literal["observer", "truck"], typer.Option(help="The state observer, or the linear model of the truck.")
    ] = "observer",
    fmi: Annotated[int, typer.Option(min=2, max=3, help="Version of the standard: 2 (2.0) or 3 (3.0).")] = 3,
    identification: Annotated[
        Path | None,
        typer.Option("--identification", "-i", help=f"{IDENTIFICATION}. {common.OF_RESULT}"),
    ] = None,
    signal: Annotated[
        list[str] | None,
        typer.Option(
            "--signal",
            help=f"A signal that the observer measures, or an output of the truck; may be repeated. {MEASURED} "
            "The truck gives every quantity that a sensor could measure.",
        ),
    ] = None,
    tunable: Annotated[
        list[str] | None,
        typer.Option(
            help="A parameter of the truck that the importer can change, by its path or its last part; may be "
            "repeated. Default: those that fifthwheel identify estimates."
        ),
    ] = None,
    *,
    chosen: ObserverOptions,
    sources_only: Annotated[
        bool, typer.Option("--sources-only", help="No libraries; the importer compiles the sources.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File to write. Default: fifthwheel-observer.fmu or -truck.fmu.")
    ] = None,
    force: common.ForceFileOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """Write the state observer, or the linear model of the truck, as an FMU for Simulink, Modelica and other tools.

    The FMU is for co-simulation. It has its sources, and libraries for 64-bit Linux and Windows, compiled by ziglang
    (pip install 'fifthwheel[fmu]').
    """
    from fifthwheel.apps.workflow.inputs import read_vehicle
    from fifthwheel.apps.workflow.runs import exported_observer
    from fifthwheel.base.errors import FifthwheelError
    from fifthwheel.results.export import PLATFORMS, export_fmu

    path = out or Path(f"fifthwheel-{what}.fmu")
    platforms = () if sources_only else tuple(PLATFORMS)
    of_observer = [*(["--identification"] if identification else []), *_of_an_observer(chosen)]
    refused = (["--tunable"] if tunable else []) if what == "observer" else of_observer
    if refused:
        other = "truck" if what == "observer" else "observer"
        raise FifthwheelError(f"{', '.join(refused)}: only for --what {other}; remove it, or export the {other}")
    with reserved(path, force=force):
        if what == "observer":
            truck, stored, _ = _known(vehicle, identification)
            export_fmu(exported_observer(truck, signal, stored, chosen), path, fmi=fmi, platforms=platforms)
        else:
            export_fmu(read_vehicle(vehicle), path, fmi=fmi, outputs=signal, tunable=tunable, platforms=platforms)
    if as_json:
        common.print_json({"file": str(path), "fmi": fmi, "platforms": platforms})
    else:
        typer.echo(f"{path}: FMI {fmi}.0 co-simulation, {', '.join(platforms) or 'sources only'}")


def _of_an_observer(chosen: ObserverOptions) -> list[str]:
    """The options that were given and that only an observer has."""
    return [text.partition("=")[0] for text in arguments(replace(chosen, min_speed=ObserverOptions.min_speed))]


def _known(vehicle: str, identification: Path | None) -> "tuple[Vehicle, Identification | None, list[Path]]":
    """The vehicle, the identification if there is one, and the files that were read."""
    from fifthwheel.apps.workflow.inputs import read_vehicle, vehicle_and_identification
    from fifthwheel.estimate.identify import Identification

    vehicle, identification = vehicle_and_identification(vehicle, identification)
    files = [Path(vehicle), *([identification] if identification else [])]
    return read_vehicle(vehicle), Identification.load(identification) if identification else None, files
