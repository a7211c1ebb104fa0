"""The result of an identification: values, sigmas and verdicts, and the data to judge or repeat it."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np

from fifthwheel.base.errors import FifthwheelError, suggestion
from fifthwheel.base.lazy import require
from fifthwheel.base.options import FRICTION_RANGE
from fifthwheel.data.channels import (
    LATERAL_ACCELERATION,
    SPEED,
    STEER,
    WHEEL_SPEED_DIFFERENCE,
    Channel,
    is_of,
    is_sensor_error,
)
from fifthwheel.estimate.identify.result.parts import Estimate, IdentificationData
from fifthwheel.estimate.identify.statement import prior_of
from fifthwheel.estimate.identify.unknowns.parameters import prior_of_sensor_error
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.estimate.observe.uncertainty import Uncertainty
from fifthwheel.model.dynamics.unit_equations import BANK
from fifthwheel.truck.quantities import (
    BANK_VARIATION,
    DRIVE_AXLE_BRAKING,
    FRICTION,
    HALF_TRACK,
    ROAD_BANK,
    TIME_BASE,
    quantity_of,
    unit_of,
)

if TYPE_CHECKING:
    import pandas as pd

    from fifthwheel.base import pages
    from fifthwheel.base.plots import Plot
    from fifthwheel.estimate.identify.result.posterior import Posterior
    from fifthwheel.estimate.observe import Observer, ObserverSettings


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Identification(IdentificationData):
    """The result of an identification.

    It is data. What its methods make of it, such as plots, files and an observer, is imported when they are called.

    Example:
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> record = fw.simulate(truck, count=1)
        >>> settings = fw.OneStage(given={"*": "exact", "tractor.front.cornering_stiffness": "free"}, tyres="linear")
        >>> result = fw.identify([record], truck, settings)
        >>> result
        Identification(cheng_cebon_2011, one-stage method, 1 of 1 parameters converged, from simulated)
        >>> result.to_pandas().loc["tractor.front.cornering_stiffness", "unit"]
        'N/rad'
        >>> result.plot("fits")
        Plot('cheng_cebon_2011, one-stage method', 4 panels)
        >>> states = result.observer().batch(record, result.uncertainty())
    """

    def __getitem__(self, name: str) -> Estimate:
        """The estimate of a parameter, derived quantity or uncertain number by name; KeyError if there is none."""
        estimates = {estimate.name: estimate for estimate in (*self.uncertain, *self.derived, *self.parameters)}
        if name not in estimates:
            raise KeyError(f"{name}: not estimated; {suggestion(str(name), estimates)}")
        return estimates[name]

    def __iter__(self) -> Iterator[str]:
        """The names of all estimates."""
        return iter(dict.fromkeys(e.name for e in (*self.parameters, *self.derived, *self.uncertain)))

    def __contains__(self, name: object) -> bool:
        return name in list(self)

    def _ipython_key_completions_(self) -> list[str]:
        """What a notebook offers within the brackets."""
        return list(self)

    def observer_settings(self, log: str | None = None, **changes: Any) -> "ObserverSettings":
        """Settings for an `Observer` of this vehicle with the estimated sensor errors and noise.

        Args:
            log: its sensor errors and noise; None for the errors that all logs share and the noise of the first.
            changes: further settings.
        """
        from fifthwheel.estimate.observe import ObserverSettings

        return ObserverSettings(**self.sensor_settings(log) | changes)

    @property
    def friction(self) -> float | None:
        """Peak friction of the road; None with linear tyres.

        Logs that use little of the friction do not limit it upwards. An observer gets the nearest friction that a road
        has.
        """
        settings = self.settings
        if settings.tyre_law == "linear":
            return None
        estimated = next((e.value for e in self.parameters if e.name == FRICTION), None)
        estimated = prior_of(settings.given, FRICTION)[0] if estimated is None else estimated
        return min(max(estimated, FRICTION_RANGE[0]), FRICTION_RANGE[1])

    @property
    def models_roll(self) -> bool:
        """Whether the method modelled yaw and roll, and not yaw only: one stage unless `roll=False`, two stages if a
        roll rate is measured."""
        return self.settings.models_roll(self.signals)

    @property
    def model(self) -> str:
        """The motion that the method modelled, in words, with the name of own equations of the steering."""
        motion = "yaw and roll" if self.models_roll else "yaw only"
        own = self.vehicle.steering
        return f"{motion}, own steering {own.name}" if own else motion

    def sensor_settings(self, log: str | None = None) -> dict[str, Any]:
        """Sensor errors, noise, own tyre law, and friction and bank of the road, as arguments of `ObserverSettings`.

        Args:
            log: its sensor errors, noise and bank, besides the errors that all logs share; None or another log for the
                latter only, the noise of the first log, and the priors of steering offset and bank.
        """
        of_observer = [e for e in self.sensors if not (e.name.startswith(f"{TIME_BASE}.") or is_of(e.name, SPEED))]
        errors = {error.name: error.value for error in of_observer if error.log in (None, log)}
        noise = next((summary.noise for summary in self.logs if summary.name == log), self.logs[0].noise)
        law = self.settings.tyre_law
        own_law = {} if isinstance(law, str) else {"tyres": law}
        yaw_only = {} if self.settings.roll else {"roll": False}
        unseen = (quantity_of(DRIVE_AXLE_BRAKING).mean, 0.0) if self.settings.brakes else None
        brakes = next((summary.drive_axle_braking for summary in self.logs if summary.name == log), unseen)
        around = {**self.surroundings} | ({DRIVE_AXLE_BRAKING: brakes[0]} if brakes else {})
        road = {"friction": self.friction, "surroundings": around} | self._uncertainties(log)
        road |= {"half_track": around.pop(HALF_TRACK)} if HALF_TRACK in around else {}
        return {"sensor_errors": errors, "noise": noise} | own_law | yaw_only | road

    def _uncertainties(self, log: str | None) -> dict[str, float]:
        """Mean and sigma of the bank, and sigmas of the offsets, as arguments of `ObserverSettings`."""
        settings = self.settings
        _, prior = prior_of(settings.given, ROAD_BANK)
        estimates = [each.bank for each in self.logs if each.name == log and each.bank]
        _, variation = prior_of(settings.given, BANK_VARIATION)
        mean, bank = (estimates[0][0], math.hypot(estimates[0][1], variation)) if estimates else (0.0, prior)
        own = [error for error in self.sensors if error.log is not None and error.log == log]

        def offset(channel: Channel) -> float:
            measured = [signal for signal in self.signals if is_of(signal, channel)] or [channel.quantity]
            priors = [self.prior_of_sensor_error(f"{signal}.offset") for signal in measured]
            prior = max(sigma for _, sigma in priors)
            offsets = [error for error in own if is_sensor_error(error.name, "offset")]
            sigmas = [error.sigma for error in offsets if is_of(error.name, channel)]
            known = self.covariance is not None and sigmas  # it contains them
            return 0.0 if known else max(sigmas, default=prior)

        return {
            "bank_mean": mean,
            "bank": bank,
            "steer_offset": offset(STEER),
            "acceleration_offset": offset(LATERAL_ACCELERATION),
            "wheel_speed_offset": offset(WHEEL_SPEED_DIFFERENCE),
        }

    def prior_of_sensor_error(self, name: str) -> tuple[float, float]:
        """Prior mean and standard deviation of an error of a sensor or a time base, SI."""
        own = prior_of_sensor_error(self.initial_vehicle, name, self.settings)
        return own or prior_of(self.settings.given, name)

    @property
    def posterior(self) -> "Posterior":
        """The joint posterior of parameters, uncertain numbers, sensor errors, and bank of the road.

        Raises:
            FifthwheelError: the method gives no joint posterior.
        """
        from fifthwheel.estimate.identify.result.posterior import Posterior

        if self.covariance is None:
            raise FifthwheelError(f"posterior: the {self.method} method has none; identify with OneStage()")
        of_vehicle = self.vehicle.parameters().items()
        known = {name: (value, unit_of(name)) for name, value in of_vehicle if name in self.covariance.names}
        known |= {name: (value, unit_of(name)) for name, value in self.surroundings.items()}
        known |= {e.name: (e.value, e.unit) for e in (*self.parameters, *self.uncertain)}
        known |= {f"{e.name}@{e.log}" if e.log else e.name: (e.value, e.unit) for e in self.sensors}
        known |= {f"{BANK}@{log.name}": (log.bank[0], "rad") for log in self.logs if log.bank}
        of_brakes = {log.name: log.drive_axle_braking for log in self.logs if log.drive_axle_braking}
        known |= {f"{DRIVE_AXLE_BRAKING}@{name}": (value, "1") for name, (value, _) in of_brakes.items()}
        uncertainty = self.covariance.among(known)  # other names follow from these, or are priors of other logs
        values, units = zip(*[known[name] for name in uncertainty.names], strict=True)
        return Posterior(uncertainty=uncertainty, mean=np.array(values), units=units)

    def uncertainty(self, log: str | None = None) -> Uncertainty | None:
        """Joint uncertainty of parameters and sensor errors for an `Observer`, with the sensor errors of one log; with
        their priors for None or another log."""
        return None if self.covariance is None else self.covariance.of_log(log or "")

    def as_dict(self) -> dict[str, Any]:
        """The content of identification.json: everything but time series."""
        from fifthwheel.estimate.identify.result import storage

        return storage.contents_of(self)

    def to_json(self) -> str:
        """`as_dict` as JSON; a number that is not finite becomes null."""
        from fifthwheel.estimate.identify.result import storage

        return storage.as_json(self.as_dict())

    def observer(self, signals: Iterable[str] | None = None, *, log: str | None = None, **changes: Any) -> "Observer":
        """An observer of the identified vehicle, with the estimated sensor errors and noise.

        Args:
            signals: available signals; those of the identification by default.
            log: its sensor errors and noise; by default the errors that all logs share.
            changes: further settings, as of `ObserverSettings`.
        """
        from fifthwheel.estimate.observe import Observer

        return Observer(
            self.vehicle, self.signals if signals is None else signals, self.observer_settings(log, **changes)
        )

    def summary(self) -> str:
        """A table of parameters with sigma and verdict, derived quantities and fits, the doubts, and the notes."""
        return str(self._document())

    def to_pandas(self) -> "pd.DataFrame":
        """Parameters, stated numbers and derived quantities by name: value, sigma, initial and prior in SI, verdict.

        Raises:
            FifthwheelError: pandas is not installed.
        """
        pandas = require("pandas", "pandas")
        columns = ("value", "sigma", "unit", "initial", "prior", "verdict")
        estimates = (*self.parameters, *self.stated_numbers, *self.derived)
        rows = [[*(getattr(e, name) for name in columns[:-1]), str(e.verdict)] for e in estimates]
        index = pandas.Index([e.name for e in estimates], name="parameter")
        frame: pd.DataFrame = pandas.DataFrame(rows, index=index, columns=list(columns))
        return frame.astype({"sigma": float, "prior": float})

    def residuals(self, *, whitened: bool = False) -> "pd.DataFrame":
        """Residuals of every log, one column for each channel, by log and time in s; NaN where missing.

        Args:
            whitened: those at the maximum of the posterior, filtered by their noise model, in standard deviations: of
                a right model they are white noise with variance 1. Otherwise those of `fits`, measured less predicted
                by the free-running model in SI, also of validation logs.

        Raises:
            FifthwheelError: the result was loaded without time series, the method does not whiten residuals, or pandas
                is not installed.
        """
        pandas = require("pandas", "pandas")
        if not any(fit.time.size for fit in self.fits):
            raise FifthwheelError("residuals: the file of this identification has no time series; identify again")
        fits = [fit for fit in self.fits if fit.whitened.size or not whitened]
        if not fits:
            raise FifthwheelError("whitened: this identification has no such residuals; identify with OneStage()")
        frames: dict[str, dict[str, pd.Series]] = {}
        for fit in fits:
            values = fit.whitened if whitened else fit.measured - fit.predicted
            frames.setdefault(fit.log, {})[fit.signal] = pandas.Series(values, pandas.Index(fit.time, name="time"))
        frame: pd.DataFrame = pandas.concat({log: pandas.DataFrame(of_log) for log, of_log in frames.items()})
        return frame.rename_axis(index=["log", "time"])

    def plot(
        self, kind: Literal["parameters", "fits", "residuals", "histories"] = "parameters", *, log: str | None = None
    ) -> "Plot":
        """A plot of the result.

        Args:
            kind: "parameters" with sigma and initial value; "fits", measured and predicted signals; "residuals" of
                the fits; "histories" of the estimates.
            log: for fits and residuals; the first by default.

        Raises:
            SignalError: the kind or the log does not exist, or the result was loaded without time series.
        """
        from fifthwheel.estimate.identify.result import display

        return display.plot(self, self._title, kind, log)

    def save(self, folder: str | Path) -> None:
        """Write identification.json, vehicle.toml, knowledge.json and series.npz, the time series, to a folder.

        The folder is made if it does not exist. Each file is written atomically. `load` reads an equal identification.

        Raises:
            FifthwheelError: a file of one of these names is there, but no earlier result.
            OSError: a file cannot be written.
        """
        from fifthwheel.estimate.identify.result import storage

        storage.save(self, Path(folder))

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """The identification in a folder, or of an identification.json, which `save` or `fifthwheel identify` wrote.

        Values, covariance, settings and sensor errors are exactly those that were saved. Fits and histories are
        without time series if there is no series.npz beside the file, and without knowledge if no knowledge.json.

        Raises:
            SignalError: the file cannot be read, or is not one of an identification.
        """
        from fifthwheel.estimate.identify.result import storage

        return storage.load(Path(path), cls._checked)

    @classmethod
    def _checked(cls, **fields: Any) -> Self:
        """An identification whose sensor errors and noise are possible."""
        identification = cls(**fields)
        for name in (None, *[log.name for log in identification.logs]):
            identification.observer_settings(name)
        return identification

    @property
    def _title(self) -> str:
        return f"{self.vehicle.name}, {self.method} method"

    def __repr__(self) -> str:
        estimated = [e for e in self.parameters if e.verdict is not Verdict.FIXED]
        converged = sum(e.verdict is Verdict.CONVERGED for e in estimated)
        logs = ", ".join(log.name for log in self.logs[:3]) + (", ..." if len(self.logs) > 3 else "")
        return f"Identification({self._title}, {converged} of {len(estimated)} parameters converged, from {logs})"

    def _repr_html_(self) -> str:
        """What a notebook shows: tables of estimates and fits."""
        from fifthwheel.base.pages.html import notebook

        return notebook(self._document())

    def _document(self) -> "pages.Document":
        from fifthwheel.estimate.identify.result import display

        return display.document(self, f"{self._title}, {self.model}")
