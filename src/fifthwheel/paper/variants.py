"""What moves the article's preset: settings that the article leaves open, and what its models leave out.

Each variant changes one thing of section 3's experiment.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

from fifthwheel.identify import TwoStage, article
from fifthwheel.paper.experiments import Arm, Experiment, scaled
from fifthwheel.plant import Plant, Properties
from fifthwheel.plant.courses import lane_changes
from fifthwheel.vehicle import Vehicle


@dataclass(frozen=True, kw_only=True)
class Variant:
    """One change."""

    name: str
    settings: Callable[[TwoStage], TwoStage] = lambda settings: settings
    properties: Properties = Properties()  # noqa: RUF009 - frozen
    told: Callable[[Vehicle], Vehicle] = lambda truck: truck
    rate: float = 100.0  # Hz
    repetitions: float = 1.0  # times those of section 3
    late: float = 0.0  # by which the steer angle is logged late, s


def on_axis(truck: Vehicle) -> dict[str, float]:
    """Suspension roll centres at the roll axis of the vehicle file."""
    return {unit.group_path(group): unit.roll_axis_height for unit in truck.units for group in unit.axle_groups}


def variants(truck: Vehicle) -> tuple[Variant, ...]:
    """All of them; the first changes nothing."""
    return (
        Variant(name="as in section 3"),
        Variant(name="estimator: twice the repetitions", repetitions=2),
        Variant(name="estimator: P_p(0) ten times Q_p^(1/2)", settings=lambda s: replace(s, initial_sigma=0.01)),
        Variant(name="estimator: sampled at 50 Hz", rate=50),
        Variant(name="estimator: sampled at 200 Hz", rate=200),
        Variant(name="estimator: steer angle held over a sample", late=0.005),
        Variant(name="estimator: knows the tyres' relaxation length", settings=lambda s: replace(s, relaxation=True)),
        Variant(name="estimator: tractor yaw inertia 10 % too large", told=lambda v: raised(v, "tractor.yaw_inertia")),
        Variant(name="estimator: suspensions 10 % too stiff in roll", told=lambda v: scaled(v, "roll_stiffness", 1.1)),
        Variant(name="truck: tyres without relaxation length", properties=Properties(relaxation=0.01)),
        Variant(name="truck: roll centres on the roll axis", properties=Properties(roll_centre=on_axis(truck))),
        Variant(name="truck: tyres with pneumatic trail", properties=Properties(aligning=1.0)),
        Variant(name="truck: trailer axles steer in roll, 0.1", properties=Properties(roll_steer={"semitrailer": 0.1})),
        Variant(name="truck: wet road, friction 0.6", properties=Properties(friction=0.6)),
    )


def raised(truck: Vehicle, path: str) -> Vehicle:
    """The truck with one value 10 % larger."""
    return truck.replace({path: 1.1 * truck.parameters()[path]})


def varied(base: Experiment, variant: Variant, *, repetitions: int) -> Experiment:
    """Section 3's experiment with the one change; both arms, the preset and our default."""
    drive = base.drive
    count = round(repetitions * variant.repetitions)
    if variant.properties != Properties() or variant.rate != 100 or count != repetitions:
        drive = Plant(drive.vehicle, variant.properties).drive(lane_changes(count=count), rate=variant.rate)
    sensors = dict(base.sensors)
    if variant.late:
        steer = drive.vehicle.steer_signals()[0]
        sensors[steer] = replace(sensors[steer], latency=variant.late)
    told = variant.told(base.arms[0].told)
    arms = (
        Arm(name="article", settings=variant.settings(article()), told=told),
        Arm(name="default", settings=TwoStage(), told=told),
    )
    return replace(base, name=variant.name, drive=drive, sensors=sensors, arms=arms)
