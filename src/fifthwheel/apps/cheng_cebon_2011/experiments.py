"""The experiments of the article on the nonlinear truck, and variants of them that change one thing.

An experiment is one run of the nonlinear truck and several arms: ways to identify it. All arms see the same sensor
noise. Each parameter of stage 1 starts at 80 or 120 % of its value in the assumed vehicle, drawn by the seed, and the
payload height starts at 0.1 m (sections 3.1 and 3.3).

`RESULTS` has every number that the article publishes as a result. C. Cheng, D. Cebon, "Parameter and state estimation
for articulated heavy vehicles", Vehicle System Dynamics 49 (2011) 399-418. Cornering stiffness is positive here, as
everywhere in this package.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from fifthwheel.apps.cheng_cebon_2011.settings import TwoStage, article
from fifthwheel.apps.studies.scenarios import effective_stiffness
from fifthwheel.base.names import ParameterPath
from fifthwheel.estimate.identify import OneStage
from fifthwheel.estimate.identify.settings import CommonSettings
from fifthwheel.model.manoeuvres import lane_changes, lane_changes_on_test_track
from fifthwheel.model.plant import Plant, PlantRun, Properties, Sensor, article_sensors
from fifthwheel.truck import Vehicle, get

FRONT = "tractor.front.cornering_stiffness"
DRIVE = "tractor.drive.cornering_stiffness"
TRAILER = "semitrailer.cornering_stiffness"
YAW_INERTIA = "semitrailer.yaw_inertia"
PAYLOAD_HEIGHT = "semitrailer.payload.height"
COG_HEIGHT = "semitrailer.cog_height"
ROLL_INERTIA = "semitrailer.roll_inertia"

SPEED = 88 / 3.6
"""Speed of section 3, m/s."""
TEST_SPEED = 35 / 3.6
"""Speed of section 4, m/s; an assumption, the article does not state it."""
LANDING_LEG = "sideslip.semitrailer.landing_leg"
OPTICAL_SIGMA = 0.002
"""Standard deviation of the noise of the optical sideslip sensor, rad; an assumption, the article does not state it."""
MANUFACTURER_FRONT_STIFFNESS = 4.20e5
"""Front cornering stiffness to which the article fixes that of its test vehicle, N/rad (section 4.2)."""
ROLL_STIFFNESS_ERROR = 1.1
"""Ratio of assumed to true roll stiffness of the suspensions in the experiment with errors."""
BIASES = {
    "steer.tractor.front": 0.001,
    "yaw_rate.tractor": 0.002,
    "yaw_rate.semitrailer": -0.001,
    "roll_rate.tractor": 0.002,
    "roll_rate.semitrailer": -0.001,
}
"""Biases of the sensors in the experiment with errors, rad and rad/s."""


@dataclass(frozen=True)
class Published:
    """One published number."""

    case: str  # the experiment of the article: "simulation", "point payload" or "test vehicle"
    place: str  # section of the article
    quantity: str  # parameter or derived quantity
    value: float  # SI
    reference: float | None = None  # the article's reference value, SI
    error: float | None = None  # the error that the article states, as a fraction of its reference


RESULTS = (
    Published("simulation", "3.2", FRONT, 4.77e5),
    Published("simulation", "3.2", DRIVE, 8.98e5),
    Published("simulation", "3.2", TRAILER, 1.30e6),
    Published("simulation", "3.2", YAW_INERTIA, 4.24e5, 4.24e5 / 1.025, 0.025),
    Published("simulation", "3.3", PAYLOAD_HEIGHT, 1.237, 1.23, 0.006),
    Published("simulation", "3.3", COG_HEIGHT, 1.602, 1.60, 0.001),
    Published("simulation", "3.3", ROLL_INERTIA, 4.35e4, 4.35e4 / 1.004, 0.004),
    Published("point payload", "3.3", PAYLOAD_HEIGHT, 1.084, 1.23, -0.119),
    Published("point payload", "3.3", COG_HEIGHT, 1.553, 1.60, -0.029),
    Published("point payload", "3.3", ROLL_INERTIA, 3.99e4, 33308, 0.20),
    Published("test vehicle", "4.2", DRIVE, 1.12e6),
    Published("test vehicle", "4.2", TRAILER, 1.66e6),
    Published("test vehicle", "4.2", YAW_INERTIA, 3.59e5, 3.80e5, -0.06),
    Published("test vehicle", "4.3", PAYLOAD_HEIGHT, 1.257, 1.145, 0.098),
    Published("test vehicle", "4.3", COG_HEIGHT, 1.609),
    Published("test vehicle", "4.3", ROLL_INERTIA, 4.40e4),
)


@dataclass(frozen=True, kw_only=True)
class Arm:
    """One way to identify."""

    name: str
    settings: CommonSettings
    assumed: Vehicle  # the vehicle that the estimator assumes, before the initial values are drawn
    fixed: Mapping[str, float] = field(default_factory=dict)  # values of the fixed parameters


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """One run of the nonlinear truck, and the arms that identify it."""

    name: str
    case: str  # the case of `RESULTS` that it repeats
    run: PlantRun
    sensors: Mapping[str, Sensor]
    arms: tuple[Arm, ...]
    stiffness: Mapping[str, tuple[float, float]]
    """Effective cornering stiffness in two steady turns, N/rad, by parameter; see `effective_stiffness`."""
    published: bool = True  # whether the truck is that of the article, so that the published numbers apply


def point_payload(truck: Vehicle) -> Vehicle:
    """The truck with its payload as a point at half its height on the centre line."""
    described = truck.model_dump()
    for unit in described["units"]:
        if unit["payload"]:
            unit["payload"]["shape"] = "point"
    return Vehicle(**described)


def with_factor(truck: Vehicle, paths: Mapping[str, float]) -> Vehicle:
    """The truck with some parameters multiplied by a factor, given by path."""
    values = truck.parameters()
    return truck.replace({path: values[path] * factor for path, factor in paths.items()})


def group_paths(truck: Vehicle, quantity: str) -> list[str]:
    """Paths of a quantity of all axle groups; couplings may have a quantity of the same name."""
    units = [unit.name for unit in truck.units]
    paths = {path: ParameterPath.of(path) for path in truck.parameters()}
    return [path for path, parsed in paths.items() if parsed.quantity == quantity and parsed.unit in units]


def section_3(*, repetitions: int, truck: Vehicle | None = None, point: bool = False) -> Experiment:
    """Section 3: repeated lane changes of SAE J2179 at 88 km/h; `truck` in place of that of the article.

    With `point`, the payload is a point (section 3.3), while the estimator assumes a uniform payload.
    """
    name = "point payload" if point else "simulation"
    assumed, properties = truck or get("cheng_cebon_2011"), Properties()
    driven = point_payload(assumed) if point else assumed
    return Experiment(
        name=name,
        case=name,
        run=Plant(driven, properties).drive(lane_changes(count=repetitions), name=name),
        sensors=article_sensors(assumed),
        arms=(
            Arm(name="article", settings=article(), assumed=assumed),
            Arm(name="default", settings=TwoStage(), assumed=assumed),
            Arm(name="one stage", settings=OneStage(), assumed=assumed),
        ),
        stiffness=effective_stiffness(assumed, properties, SPEED),
        published=truck is None,
    )


def section_4(*, repetitions: int, errors: bool = False) -> Experiment:
    """Section 4: lane changes of 4 m in 30 m at 35 km/h with a truck similar to the test vehicle.

    `errors` are those that the article suspects in its test: the estimator assumes suspensions that are 10 % too stiff
    in roll, and the sensors have biases.
    """
    truck = get("cheng_cebon_2011_vehicle")
    assumed, sensors = truck, article_sensors(truck)
    if errors:
        assumed = with_factor(truck, dict.fromkeys(group_paths(truck, "roll_stiffness"), ROLL_STIFFNESS_ERROR))
        sensors |= {name: replace(sensors[name], bias=bias) for name, bias in BIASES.items()}
    # equation (15) has 600, 1000 and 400 for C1r, C2 and I2zz of the test vehicle: 0.05 to 0.1 % of their values
    walk = {"cornering_stiffness": "+- 0.07 %", "yaw_inertia": "+- 0.07 %"}
    preset = article(given={FRONT: "exact"}, forgetting=0.9995, Q_p=walk, P_p=article().P_p)
    front = {FRONT: MANUFACTURER_FRONT_STIFFNESS}
    arms = [
        Arm(name="article", settings=preset, assumed=assumed, fixed=front),
        Arm(name="default", settings=TwoStage(), assumed=assumed),
        Arm(name="one stage", settings=OneStage(), assumed=assumed),
        Arm(name="default, front fixed", settings=TwoStage(given={FRONT: "exact"}), assumed=assumed, fixed=front),
    ]
    name = "test vehicle with errors" if errors else "test vehicle"
    run = Plant(truck).drive(lane_changes_on_test_track(count=repetitions), name=name)
    largest = float(np.degrees(np.abs(run.truth["steer.tractor.front"]).max()))
    return Experiment(
        name=name,
        case="test vehicle",
        run=run,
        sensors=sensors,
        arms=tuple(arms[:3] if errors else arms),
        stiffness=effective_stiffness(truck, run.properties, TEST_SPEED, (0.1, largest)),
    )


@dataclass(frozen=True, kw_only=True)
class Variant:
    """One change to the experiment of section 3."""

    name: str
    settings: Callable[[TwoStage], TwoStage] = lambda settings: settings  # changes the article's preset
    properties: Properties = field(default_factory=Properties)  # properties of the nonlinear truck
    factors: Mapping[str, float] = field(default_factory=dict)  # factors on parameters of the assumed vehicle, by path
    rate: float = 100.0  # sampling rate, Hz
    repetitions: float = 1.0  # factor on the number of lane changes
    steer_latency: float = 0.0  # s


def variants(truck: Vehicle) -> tuple[Variant, ...]:
    """All variants: settings that the article does not publish, and errors of its models. The first has no change."""
    on_roll_axis = {unit.group_path(group): unit.roll_axis_height for unit in truck.units for group in unit.axle_groups}
    stiff = dict.fromkeys(group_paths(truck, "roll_stiffness"), 1.1)
    ten_times = {"cornering_stiffness": "+- 1 %", "yaw_inertia": "+- 1 %"}
    return (
        Variant(name="no change"),
        Variant(name="twice as many lane changes", repetitions=2),
        Variant(
            name="estimator: initial sigma ten times Q_p^(1/2)",
            settings=lambda s: replace(s, P_p={**s.P_p, **ten_times}),
        ),
        Variant(name="estimator: sampling rate 50 Hz", rate=50),
        Variant(name="estimator: sampling rate 200 Hz", rate=200),
        Variant(name="estimator: zero-order hold of the steer angle", steer_latency=0.005),
        Variant(name="estimator: relaxation length known", settings=lambda s: replace(s, relaxation=True)),
        Variant(name="estimator: tractor yaw inertia 10 % too large", factors={"tractor.yaw_inertia": 1.1}),
        Variant(name="estimator: suspension roll stiffness 10 % too large", factors=stiff),
        Variant(name="truck: tyres without relaxation length", properties=Properties(relaxation=0.01)),
        Variant(name="truck: roll centres on the roll axis", properties=Properties(roll_centre=on_roll_axis)),
        Variant(name="truck: tyres with pneumatic trail", properties=Properties(aligning=1.0)),
        Variant(
            name="truck: roll steer of the trailer axles 0.1", properties=Properties(roll_steer={"semitrailer": 0.1})
        ),
        Variant(name="truck: wet road, friction 0.6", properties=Properties(friction=0.6)),
    )


def with_variant(base: Experiment, variant: Variant, *, repetitions: int) -> Experiment:
    """The experiment of section 3 with one change, for the article's preset and the default."""
    run = base.run
    count = round(repetitions * variant.repetitions)
    if variant.properties != Properties() or variant.rate != 100 or count != repetitions:
        run = Plant(run.vehicle, variant.properties).drive(lane_changes(count=count), rate=variant.rate)
    sensors = dict(base.sensors)
    if variant.steer_latency:
        steer = run.vehicle.steer_signals()[0]
        sensors[steer] = replace(sensors[steer], latency=variant.steer_latency)
    assumed = with_factor(base.arms[0].assumed, variant.factors)
    arms = (
        Arm(name="article", settings=variant.settings(article()), assumed=assumed),
        Arm(name="default", settings=TwoStage(), assumed=assumed),
    )
    return replace(base, name=variant.name, run=run, sensors=sensors, arms=arms)
