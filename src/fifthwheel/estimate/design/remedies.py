"""Remedies: a number to know, a channel to log or a run to add, with the sigma that each would give."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from fifthwheel.estimate.design.predict import InformationPredictor, PredictedPosterior, RunInformation
from fifthwheel.estimate.filters.noise_model import NoiseModel
from fifthwheel.model.manoeuvres.accelerations import inverse_steer
from fifthwheel.model.manoeuvres.courses import LaneChange
from fifthwheel.truck import Unit
from fifthwheel.truck.quantities import MASS_SCALE

REPEAT, LANE_CHANGE = "again", "lane_change"
TESTED_STIFFNESS = 0.05
"""Sigma of a roll stiffness after a static roll test, as a fraction: a roll of 0.4 deg measured to 0.01 deg, and a unit
in front whose roll stiffnesses are known to 10 %."""
TESTED_AXIS = 0.02
"""Sigma of a roll axis height after a static roll test, m: 0.15 mm of a dial gauge at that roll."""


@dataclass(frozen=True, kw_only=True)
class Remedy:
    """One change, or two together, and the sigma of a parameter that it would give."""

    known: tuple[str, ...] = ()
    """Parameters, sensor errors or changes of the vehicle file to be known exactly; `MASS_SCALE` stands for the masses
    of all units."""
    drive: str | None = None
    """Run to be added: `REPEAT` for the same runs again, `LANE_CHANGE` for one lane change of SAE J2179."""
    channel: str | None = None
    """Signal to be logged."""
    roll_test: str | None = None
    """Unit for a static roll test, which determines its roll stiffness to `TESTED_STIFFNESS` and the height of its roll
    axis to `TESTED_AXIS`."""
    sigma: float = float("nan")
    """Predicted standard deviation of the parameter, SI."""

    @property
    def kind(self) -> str:
        """What to do: "know", "log", "test" or "drive"."""
        return "know" if self.known else "log" if self.channel else "test" if self.roll_test else "drive"


Change = tuple[Remedy, PredictedPosterior]
"""A remedy and the posterior that it would give."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PredictedRemedies:
    """Every remedy for some runs, with its posterior; made by `of`."""

    predictor: InformationPredictor
    runs: tuple[RunInformation, ...]
    knowable: tuple[str, ...]  # what could be known, as in `Remedy.known`
    single: tuple[Change, ...]  # one change
    double: tuple[Change, ...]  # one more lane change and one more channel

    @classmethod
    def of(
        cls,
        predictor: InformationPredictor,
        runs: Sequence[RunInformation],
        lane_change: RunInformation,
        *,
        estimated_knowable: bool = True,
    ) -> "PredictedRemedies":
        """The posterior of every remedy, after some runs and one lane change with the same channels.

        `estimated_knowable`: whether also an estimated parameter could be known.
        """
        knowable = [n for n in _knowable(predictor) if estimated_knowable or n not in predictor.setup.estimated]
        logged = {name for run in runs for name in run.logged}
        not_logged = [name for name in predictor.setup.outputs if name not in logged]
        with_lane_change = [*runs, lane_change]
        return cls(
            predictor=predictor,
            runs=tuple(runs),
            knowable=tuple(knowable),
            single=(
                (Remedy(drive=REPEAT), predictor.posterior([*runs, *runs])),
                (Remedy(drive=LANE_CHANGE), predictor.posterior(with_lane_change)),
                *[_with_known(predictor, runs, (name,)) for name in knowable],
                *[
                    _with_roll_test(predictor, runs, unit)
                    for unit in predictor.setup.vehicle.units
                    if len(unit.axle_groups) == 1
                ],
                *[(Remedy(channel=name), predictor.posterior(runs, added=[name])) for name in not_logged],
            ),
            double=tuple(
                (Remedy(drive=LANE_CHANGE, channel=name), predictor.posterior(with_lane_change, added=[name]))
                for name in not_logged
            ),
        )

    def best(
        self, name: str, sigma: float, *, target: float, min_reduction: float, max_count: int
    ) -> tuple[Remedy, ...]:
        """The best remedies of each kind for a parameter whose predicted sigma and wanted sigma (`target`) are in SI.

        Two changes are combined only if no single one suffices, and a second known number is added only if the first
        does not reach the target. A remedy reduces sigma by at least the fraction `min_reduction`.
        """
        kept = 1 - min_reduction
        best = self._best_of_each_kind(self.single, name, kept * sigma)
        best = best or self._best_of_each_kind(self.double, name, kept * sigma)
        for remedy in [r for r in best if r.kind == "know" and r.sigma > target and len(best) < max_count]:
            others = [(*remedy.known, other) for other in self.knowable if other not in remedy.known]
            pairs = [_with_known(self.predictor, self.runs, both) for both in others]
            best += self._best_of_each_kind(pairs, name, kept * remedy.sigma)
        return tuple(sorted(best, key=lambda remedy: (len(remedy.known), remedy.sigma))[:max_count])

    def _best_of_each_kind(self, changes: Sequence[Change], name: str, limit: float) -> list[Remedy]:
        """The remedy of each kind that gives a parameter the smallest sigma, if that is at most the limit, SI."""
        prior, best = self.predictor.prior_sigma(name), dict[str, Remedy]()
        remedies = [
            replace(remedy, sigma=after.reliable_sigma(name) * prior)
            for remedy, after in changes
            if name not in remedy.known
        ]
        for remedy in sorted(remedies, key=lambda remedy: remedy.sigma):
            if remedy.sigma <= limit:
                best.setdefault(remedy.kind, remedy)
        return list(best.values())


def _with_known(predictor: InformationPredictor, runs: Sequence[RunInformation], known: tuple[str, ...]) -> Change:
    return Remedy(known=known), predictor.posterior(runs, known=_unknowns(predictor, *known))


def _with_roll_test(predictor: InformationPredictor, runs: Sequence[RunInformation], unit: Unit) -> Change:
    (group,) = unit.axle_groups
    path, total = unit.group_path(group), group.total_roll_stiffness
    springs = {f"{path}.{key}": (total / getattr(group, key)) ** 2 for key in ("roll_stiffness", "tyre_roll_stiffness")}
    stiffness = float(np.linalg.norm([slope * _prior_sigma(predictor, name) for name, slope in springs.items()]))
    axis = f"{unit.name}.roll_axis_height"
    factors = dict.fromkeys(springs, _ratio(TESTED_STIFFNESS * total, stiffness))
    factors[axis] = _ratio(TESTED_AXIS, _prior_sigma(predictor, axis))
    return Remedy(roll_test=unit.name), predictor.posterior(runs, better_known=factors)


def _prior_sigma(predictor: InformationPredictor, path: str) -> float:
    """Prior standard deviation of a parameter by all unknowns that alter it, SI."""
    return float(np.linalg.norm([u.slopes.get(path, 0.0) * u.prior_sigma for u in predictor.setup.unknowns]))


def _ratio(sigma: float, prior: float) -> float:
    """Factor of a prior sigma after a measurement, at most 1."""
    return min(1.0, sigma / prior) if prior else 1.0


def _knowable(predictor: InformationPredictor) -> list[str]:
    """What could be known, as in `Remedy.known`; one scale weighs all units, so their masses are known together."""
    unknowable = ".softening", ".variation", ".self_steering"  # which no simple test gives
    names = [u.name for u in predictor.setup.unknowns if not u.name.endswith(unknowable)]
    weighed = _unknowns(predictor, MASS_SCALE)[1:] if MASS_SCALE in names else []
    return [name for name in names if name not in weighed]


def _unknowns(predictor: InformationPredictor, *known: str) -> list[str]:
    """The unknowns that are known with what `Remedy.known` names."""
    masses = [f"{unit.name}.mass" for unit in predictor.setup.vehicle.units] if MASS_SCALE in known else []
    return [*known, *masses]


def lane_change_information(
    predictor: InformationPredictor,
    *,
    speed: float,
    rate: float,
    noise: Mapping[str, float],
    noise_models: Mapping[str, NoiseModel] = MappingProxyType({}),
) -> RunInformation:
    """Information of one lane change of SAE J2179 at a speed, m/s, and a sampling rate, Hz.

    `noise` and `noise_models` are as in `InformationPredictor.steered_run`.
    """
    lane_change = LaneChange()
    time = np.arange(round(lane_change.period(speed) * rate)) / rate
    steer = inverse_steer(predictor.start_vehicle, speed, time, lane_change.acceleration(time, speed, 1))
    return predictor.steered_run("one more lane change", speed, steer, rate, noise, noise_models)
