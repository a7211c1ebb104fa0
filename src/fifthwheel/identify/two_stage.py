"""Parameter estimation in two stages, as in Figure 2 of the article.

    logs, vehicle -> stage 1 (yaw model): cornering stiffnesses, trailer yaw inertia
                  -> stage 2 (yaw-roll model): payload height, and with it CoG height and roll inertia (8), (9)
                  -> identified vehicle

The article stops there. Its stage 1 knows no roll, which on its own truck moves the parameters by 2 to 4 %; by default
both stages therefore come round again, now with the yaw-roll model and the height just found, until nothing moves.
"""

import itertools
import math
from collections.abc import Sequence

import fifthwheel
from fifthwheel import dynamics
from fifthwheel.dynamics import ChainModel
from fifthwheel.errors import VehicleError
from fifthwheel.filters import dual
from fifthwheel.identify import estimates, information, parameters, stage
from fifthwheel.identify.drives import Drives
from fifthwheel.identify.estimates import SETTLED_PART, settled_since
from fifthwheel.identify.information import Information
from fifthwheel.identify.parameters import Unknown
from fifthwheel.identify.result import Identification
from fifthwheel.identify.settings import TwoStage
from fifthwheel.identify.stage import Progress, Trace, moved
from fifthwheel.logs import Record
from fifthwheel.native import compile_soon
from fifthwheel.vehicle import Vehicle


class TwoStageFit:
    """One identification in two stages; arguments as in `methods.identify`."""

    def __init__(
        self,
        records: Sequence[Record],
        vehicle: Vehicle,
        settings: TwoStage,
        validate: Sequence[Record],
        progress: Progress,
    ) -> None:
        self.drives = Drives(records, vehicle, settings, validate)
        self.settings, self.progress = settings, progress
        self.vehicle, self.logs, self.notes = self.drives.vehicle, self.drives.logs, self.drives.notes
        self.notes.append(
            "Two stages take the rest of the vehicle file for exact: what suspension, roll axes and the first unit's "
            "yaw inertia may be off by is in no sigma. One stage counts it."
        )
        if settings.average:
            self.notes.append(
                "The article's settings: more than ten lane changes are needed, and the payload height rests on "
                "stiffnesses that were found without roll; its sigma does not know of that."
            )
        self.yaw, self.roll = self.drives.yaw, self.drives.roll
        self.stage_1 = parameters.sought(self.vehicle, parameters.stage_1_names(self.vehicle), settings)
        if not self.stage_1 and not settings.nuisances:
            raise VehicleError(
                "held: every parameter of stage 1 is held and no sensor error is sought, nothing is left to do; "
                "leave one free, or seek the sensors' errors (nuisances)"
            )
        self.stage_2 = parameters.sought(self.vehicle, self._heights(), settings)
        self.values: dict[str, float] = {u.name: u.centre for u in (*self.stage_1, *self.stage_2)}
        self.traces: dict[str, Trace] = {}
        self.settled: dict[str, bool] = {}

    def run(self) -> Identification:
        """Figure 2, again without those parameters that turn out not to be excited."""
        yaw_unknowns = self._unknowns(self.yaw)
        yaw_model = stage.build(self.vehicle, self.yaw, yaw_unknowns, roll=False)
        if not self.stage_2:
            model, unknowns = yaw_model, yaw_unknowns
        else:
            unknowns = self._unknowns((*self.yaw, *self.roll))
            model = stage.build(self.vehicle, (*self.yaw, *self.roll), unknowns, roll=True)
        for m, u in ((yaw_model, yaw_unknowns), (model, unknowns)):
            compile_soon(dual.step(m, parameters.scaling(u).logarithmic))
        known = self._information(yaw_model, yaw_unknowns, gated=False)  # to begin with the yaw model will do
        self.idle = self._not_excited(known, unknowns)
        for attempt in itertools.count():
            self._begin()
            self._stages(yaw_model, yaw_unknowns, model, unknowns)
            known = self._information(model, unknowns)
            idle = self._not_excited(known, unknowns)
            if attempt:  # what the guess said may be taken back once; after that the set only grows
                idle |= self.idle
            if idle == self.idle:
                break
            self.idle = idle
        sigma = dict(zip(known.names, known.sigma.tolist(), strict=True))
        if model.roll and self.rounds == 1:  # what stage 1 found, it found without roll
            without = self._information(yaw_model, yaw_unknowns)
            moved_by = dict(zip(without.names, without.bias.tolist(), strict=True))
            sigma |= {u.name: math.hypot(sigma[u.name], moved_by[u.name]) for u in self.stage_1}
        elif not model.roll:
            self.notes.append(
                "Without stage 2 the yaw model is used, which leaves out roll; each sigma holds what that may move."
            )
        return self._result(model, unknowns, sigma)

    def _not_excited(self, known: Information, unknowns: list[Unknown]) -> set[str]:
        return {u.name for u in unknowns if not u.nuisance and not known.excited(u.name, self.settings.excited)}

    def _unknowns(self, outputs: Sequence[str]) -> list[Unknown]:
        heights = self.stage_2 if any(name.startswith("roll_rate.") for name in outputs) else []
        return [*self.stage_1, *heights, *parameters.nuisances(self.vehicle, outputs, self.settings)]

    def _begin(self) -> None:
        """Forget what an earlier attempt found."""
        given = self.vehicle.parameters()
        sought = (*self.stage_1, *self.stage_2)
        self.values = {u.name: given[u.name] if u.name in self.idle else u.centre for u in sought}
        self.traces, self.settled, self.rounds = {}, {}, 1
        self.sigma: dict[str, float] = {}
        for log in self.logs:
            log.errors.clear()
            log.noise.clear()
            log.colour.clear()

    def _stages(
        self, yaw_model: ChainModel, yaw_unknowns: list[Unknown], model: ChainModel, unknowns: list[Unknown]
    ) -> None:
        self._stage("stage 1", yaw_model, yaw_unknowns, active=[u.name for u in yaw_unknowns])
        if model is yaw_model:
            return
        rolling = [u.name for u in unknowns if u in self.stage_2 or u.name.startswith("roll_rate.")]
        yawing = [u.name for u in unknowns if u.name not in rolling]
        self._stage("stage 2", model, unknowns, active=rolling)
        while self.rounds < self.settings.rounds:
            before = dict(self.values)
            self.rounds += 1
            self._stage("stage 1", model, unknowns, active=yawing, passes=1)
            self._stage("stage 2", model, unknowns, active=rolling, passes=1)
            for name, sigma in self.sigma.items():
                self.settled[name] = not moved(
                    self.values[name] - before[name], self.values[name], sigma, self.settings
                )
            if all(self.settled.values()):
                break

    def _heights(self) -> tuple[str, ...]:
        """Payload heights that stage 2 can seek, with a note on those it cannot."""
        wanted = parameters.stage_2_names(self.vehicle)
        possible = tuple(name for name in wanted if f"roll_rate.{name.split('.')[0]}" in self.roll)
        for name in wanted:
            if name not in possible:
                unit = name.split(".")[0]
                self.notes.append(f"Stage 2 skipped for {name}: no roll_rate.{unit} in the logs.")
        if not wanted:
            self.notes.append("Stage 2 skipped: no unit of the vehicle has a payload.")
        return possible

    def _stage(
        self, title: str, model: ChainModel, unknowns: list[Unknown], *, active: list[str], passes: int | None = None
    ) -> None:
        outcome = stage.run(
            model,
            self.vehicle,
            self.logs,
            unknowns,
            active=[name for name in active if name not in self.idle],
            start=self.values,
            settings=self.settings,
            passes=passes or self.settings.passes,
            progress=self.progress,
            title=title,
        )
        self.values |= outcome.values
        self.traces[title] = self.traces[title].then(outcome.trace) if title in self.traces else outcome.trace
        self.accepted = outcome.accepted
        for i, name in enumerate(outcome.trace.names):
            self.sigma[name] = float(outcome.trace.sigma[-1, i])
            since = settled_since(outcome.trace.values[:, i], self.settings.tolerance)
            if self.settings.average:
                self.values[name] = float(outcome.trace.values[since:, i].mean())
            late = since > (1 - SETTLED_PART) * len(outcome.trace.values)
            self.settled[name] = outcome.settled if self.settings.restart else not late

    def _information(self, model: ChainModel, unknowns: list[Unknown], *, gated: bool = True) -> Information:
        return information.evaluate(
            model, self.vehicle, self.logs, unknowns, values=self.values, settings=self.settings, gated=gated
        )

    def _result(self, model: ChainModel, unknowns: list[Unknown], sigma: dict[str, float]) -> Identification:
        sought = [*self.stage_1, *self.stage_2]
        vehicle = self.vehicle.replace({u.name: self.values[u.name] for u in sought})
        plain = dynamics.model(self.vehicle, model.outputs, roll=model.roll)
        shared = {u.name: self.values.get(u.name, u.centre) for u in unknowns if u.nuisance and not u.each_log}
        found, believed = self.drives.fits(plain, vehicle, unknowns, shared)
        if not believed:
            self.settled.clear()
        told = estimates.of_parameters(
            self.drives.original, sought, self.values, sigma, self.settled, self.idle, self.traces, self.settings
        )
        return Identification(
            method="two-stage",
            vehicle=self.drives.identified(self.drives.original, {e.name: e.value for e in told}),
            initial_vehicle=self.drives.original,
            parameters=tuple(told),
            derived=tuple(estimates.derived(vehicle, told)),
            sensors=tuple(estimates.of_sensors(unknowns, self.logs, shared, sigma)),
            traces=self.traces,
            logs=tuple(
                estimates.summary(record, log, model.outputs, accepted)
                for record, log, accepted in zip(self.drives.records, self.logs, self.accepted, strict=True)
            ),
            fits=tuple(found),
            settings=self.settings,
            rounds=self.rounds,
            notes=tuple(dict.fromkeys(self.notes)),
            version=fifthwheel.__version__,
        )
