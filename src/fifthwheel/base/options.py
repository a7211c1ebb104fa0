"""The options that the command line and the workbench offer, each once: name, type, limits, default and help."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from fifthwheel.base.settings import Count, Cure, Fraction, Limits, Option, Positive, Settings

TyreLaw = Literal["linear", "saturating"]
TyreChoice = Literal["linear", "saturating", "auto"]
FRICTION_RANGE = (0.05, 6.0)
"""Of the peak friction of a road; far above 1, tyres are linear."""
Friction = Annotated[float, Limits(ge=FRICTION_RANGE[0], le=FRICTION_RANGE[1]), Cure("a dry road has 0.75")]
"""Peak friction of a road."""
Names = tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class ObserverOptions(Settings):
    """Of an observer."""

    min_speed: Annotated[
        Positive,
        Option(help="The model is not valid below this speed, m/s; no states are given there.", smallest=0.5),
    ] = 5.0
    estimate_bank: Annotated[
        bool,
        Option(flags=("--bank",), help="Also estimate the bank of the road. Default: sigma contains the bank."),
    ] = False
    """Correct the bank by measurements and report it as "bank.road". By default it is considered (Schmidt): it keeps
    its mean, because errors of the vehicle look like a bank."""
    friction: Annotated[
        Friction | None,
        Option(
            help="Tyres saturate at this peak friction of the road: 0.75 dry, 0.5 wet, 0.2 snow. For lateral "
            "accelerations above 3 m/s², braking in a turn and slippery roads. Default: that of the identification, or "
            "linear tyres.",
        ),
    ] = None
    half_track: Annotated[
        float,
        Limits(ge=0.3, le=2),
        Cure("give half the track width in m"),
        Option(
            help="Centre line to the middle of the tyres of one side, m, for the load transfer ratios; twin tyres "
            "about 0.92.",
        ),
    ] = 1.0


@dataclass(frozen=True, kw_only=True)
class IdentifyOptions(Settings):
    """Of an identification."""

    method: Annotated[
        Literal["one-stage", "two-stage", "article"],
        Option(
            help="one-stage; two-stage: dual Kalman filter; article: two-stage with the settings of Cheng and Cebon "
            "(2011).",
            choices={
                "one-stage": "One stage: all unknowns together",
                "two-stage": "Two stages: dual Kalman filter",
                "article": "Article: two stages as published",
            },
        ),
    ] = "one-stage"
    statements: Annotated[
        Names,
        Option(
            flags=("--set",),
            help="NAME=STATEMENT: what you know of a number. NAME is the path of a number of truck, sensor, "
            "road or model, the last part of it, or has * for any words. STATEMENT is a value, '+- SIGMA', both, "
            "'exact', or 'free' for a wide prior: semitrailer.mass='33.4 t +- 0.5 %', yaw_inertia=exact, "
            "road.friction=wet (dry, wet, snow, ice or unknown), 'steer.*.delay=+- 5 ms', road.bank='+- 1 deg', "
            "others=exact (all but the parameters of the result), sensors=exact. @FILE: the "
            "table [given] of a TOML file.",
            label="State a number",
        ),
    ] = ()
    any_load: Annotated[
        bool,
        Option(
            help="Estimate CoG height and roll inertia separately, for a load that is not a uniform block.",
            label="Load of any shape",
        ),
    ] = False
    knowledge: Annotated[
        Path | None,
        Option(
            help="Result folder of earlier logs of this truck, or a knowledge.json: begin with the information of "
            "these logs, and keep it with that of the new ones. --vehicle with a result folder does the same.",
            label="Begin with the knowledge of",
        ),
    ] = None
    trailer: Annotated[
        str | None,
        Option(help="Name of the trailer; by default that of the last log. Another one begins from the vehicle file."),
    ] = None
    load: Annotated[
        Names,
        Option(
            help="Load of all logs, or LOG=LOAD for one log; may be repeated. LOAD is a payload mass such as 0t or "
            "12t, a vehicle file with this load, or a name for the load of the vehicle file. Each load has its own "
            "estimates. Default: the load of the last log.",
        ),
    ] = ()
    road: Annotated[
        str | None,
        Option(
            help="Name of the road of the logs, whose friction earlier logs of it share; by default only these logs do."
        ),
    ] = None
    form: Annotated[
        Literal["output-error", "prediction-error"],
        Option(
            help="Compare the logs with a free-running model, or with one-step predictions.",
            label="Compare the logs with",
            choices={
                "output-error": "Free-running model: robust to model error",
                "prediction-error": "One-step predictions: robust to side wind",
            },
        ),
    ] = "output-error"
    tyres: Annotated[
        TyreChoice,
        Option(
            help="Model of the tyres. saturating: up to the friction of the road, which is estimated too. linear: with "
            "an unknown softening. auto: saturating if the axle loads are known, else linear.",
            choices={
                "auto": "Saturating if the axle loads are known",
                "saturating": "Saturating at the friction of the road, which is estimated",
                "linear": "Linear, with an unknown softening",
            },
        ),
    ] = "auto"
    passes: Annotated[
        Count | None, Option(help="Maximum number of passes through the logs in each stage; two stages only.")
    ] = None
    check: Annotated[
        bool,
        Option(
            flags=("--check/--no-check",),
            help="Refuse logs with implausible signals.",
            label="Refuse implausible signals",
        ),
    ] = True

    note: Annotated[
        str | None,
        Option(help="Description of the test, kept with the result.", label="Note on the test"),
    ] = None
    author: Annotated[str | None, Option(help="Who identifies, kept with the result.", label="Author")] = None


@dataclass(frozen=True, kw_only=True)
class TruckOptions(Settings):
    """Answers that describe a tractor-semitrailer; the label is the question."""

    tractor: Annotated[
        str | None, Option(help="Class of the tractor, such as tractor_4x2.", label="Class of the tractor")
    ] = None
    trailer: Annotated[
        str | None, Option(help="Class of the semitrailer, such as semitrailer_3.", label="Class of the semitrailer")
    ] = None
    wheelbase: Annotated[
        str | None,
        Option(
            help="Front axle to the first axle behind it, such as 3.7m.", label="Front axle to the first axle behind it"
        ),
    ] = None
    tractor_spread: Annotated[
        str | None,
        Option(
            help="Between the rear axles of a three-axle tractor. Default: 1.35 m.",
            label="Between the rear axles of the tractor",
        ),
    ] = None
    fifth_wheel: Annotated[
        str | None,
        Option(
            help="Front axle to the kingpin. Default: from --laden and --solo.",
            label="Front axle to the kingpin; leave it empty if you have a laden and a solo slip",
        ),
    ] = None
    fifth_wheel_height: Annotated[str | None, Option(help="Height of the fifth wheel above the ground.")] = None
    trailer_wheelbase: Annotated[str | None, Option(help="Kingpin to the middle of the trailer's axles.")] = None
    trailer_spread: Annotated[
        str | None,
        Option(
            help="Between neighbouring axles of the trailer. Default: 1.31 m.",
            label="Between neighbouring axles of the trailer",
        ),
    ] = None
    laden: Annotated[
        str | None,
        Option(
            help="Weighbridge slip of the laden truck: front, drive and trailer axles, kg.",
            label="Slip of the laden truck: front, drive and trailer axles, kg",
        ),
    ] = None
    solo: Annotated[str | None, Option(help="Slip of the tractor alone: front and drive axles, kg.")] = None
    empty: Annotated[
        str | None,
        Option(
            help="Slip of the truck without load, as --laden.",
            label="Slip of the truck without load: front, drive and trailer axles, kg",
        ),
    ] = None
    tractor_tare: Annotated[str | None, Option(help="Mass of the tractor in the brochure.")] = None
    trailer_tare: Annotated[str | None, Option(help="Mass of the trailer without load.")] = None
    load_mass: Annotated[
        str | None,
        Option(help="Mass of the load; 0 for none. Default: from the slips.", label="Mass of the load; 0 for none"),
    ] = None
    load_height: Annotated[str | None, Option(help="Height of the load, from the floor to its top.")] = None
    load_width: Annotated[str | None, Option(help="Width of the load.")] = None
    floor_height: Annotated[str | None, Option(help="Height of the floor above the ground.")] = None
    load_shape: Annotated[
        str | None,
        Option(help="uniform or point. Default: uniform.", label="Kind of load: a uniform block, or a point"),
    ] = None
    trailer_tyres: Annotated[str | None, Option(help="single or twin.", label="Tyres of the trailer")] = None


@dataclass(frozen=True, kw_only=True)
class FleetSettings(Settings):
    """How trips combine to histories, and when a history shows a change.

    Example:
        >>> import fifthwheel as fw
        >>> fw.fleet.FleetSettings(tyre_walk=0.01).false_alarms
        0.05
    """

    tyre_walk: Annotated[
        float,
        Limits(ge=0, lt=1),
        Option(help="Drift of a cornering stiffness in a day, as a fraction of its value."),
    ] = 0.005
    """Standard deviation; in n days it drifts by sqrt(n) times as much. The default is 10 % in a year, as by wear."""
    false_alarms: Annotated[Fraction, Option(help="Probability of a false change in the whole fleet, at most.")] = 0.05
    """Of a fleet without any change; the tests of all trips share it."""
    wear: Annotated[Fraction, Option(help="Drift of a cornering stiffness that needs attention, as a fraction.")] = 0.15
    """Since its first estimate."""
    height_limit: Annotated[
        Positive | None,
        Option(help="Payload height that needs attention, with a unit; a number is in m.", unit="m"),
    ] = None
    """None for no limit."""


@dataclass(frozen=True, kw_only=True)
class LiveOptions(Settings):
    """Of a live run: where frames and knowledge of the truck come from, and where the results go to."""

    bus: Annotated[
        Names,
        Option(
            help="INTERFACE:CHANNEL of python-can: socketcan:can0, virtual:truck, udp_multicast:239.0.0.1, ... Frames "
            "are sent on the first one."
        ),
    ] = ()
    bitrate: Annotated[int | None, Option(help="bit/s, for interfaces that set it; SocketCAN sets it outside.")] = None
    replay: Annotated[Path | None, Option(help="Instead of a bus: a BLF, ASC, PCAN or candump trace.")] = None
    rate: Annotated[str, Option(help="Speed of the replay: 1 is real time, 0 or max as fast as possible.")] = "1"
    identification: Annotated[
        Path | None,
        Option(flags=("--identification", "-i"), help="Folder of an identification: sensor errors and noise."),
    ] = None
    learn: Annotated[bool, Option(help="Estimate the parameters too.")] = False
    state: Annotated[
        Path | None, Option(help="File of the learned estimates; read at the start, written every 5 s.")
    ] = None
    trailer: Annotated[
        str | None, Option(help="Name of the coupled trailer; each trailer has estimates of its own.")
    ] = None
    knowledge: Annotated[
        Path | None,
        Option(
            help="Result of `fifthwheel identify` for this truck: a new --state, and a trailer that is new to it, "
            "begin with its logs."
        ),
    ] = None
    trailer_signal: Annotated[
        str | None,
        Option(help="Message.Signal whose number names the coupled trailer, and follows each change."),
    ] = None
    lock: Annotated[
        Names, Option(help="A parameter that is not learned: it keeps its estimate, or its given value.")
    ] = ()
    tyres: Annotated[
        TyreLaw,
        Option(help="Of --learn: linear, or saturating at the friction of the road, which is estimated too."),
    ] = "linear"
    coach: Annotated[
        bool, Option(help="With --learn: say what to drive next, until the parameters reach their targets.")
    ] = False
    target: Annotated[
        Names,
        Option(
            help="Of --coach: NAME=FRACTION, the required sigma of a parameter as a fraction of its value, such as "
            "semitrailer.yaw_inertia=5%. Default: as `fifthwheel design`."
        ),
    ] = ()
    max_speed: Annotated[
        str, Option(help="Of --coach: highest speed of a manoeuvre; above 88km/h it is tried too.")
    ] = "88km/h"
    send: Annotated[
        str | None,
        Option(help="Send states as CAN frames from this id on, such as 0x500 or, with 29 bits, 0x18FF0080."),
    ] = None
    send_rate: Annotated[float, Limits(ge=1, le=100), Option(help="Rate of the frames with states, Hz.")] = 100.0
    dbc: Annotated[Path, Option(help="DBC of the frames, written with --send.")] = Path("fifthwheel-live.dbc")
    record: Annotated[
        Path | None,
        Option(help="Record the states to a .parquet file. The name may contain the time: %Y-%m-%d-%H%M%S."),
    ] = None
    mcap: Annotated[
        Path | None,
        Option(
            help="Write velocity and articulation as ROS 2 messages to an .mcap file, whose name may contain the time."
        ),
    ] = None
    page: Annotated[
        str | None, Option(help="Port of the page, for this computer only, such as 8080; or HOST:PORT.")
    ] = None
