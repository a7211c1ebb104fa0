"""The information in logs, assessed before any fit: predicted sigma and verdict of every parameter, and remedies."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import starmap
from typing import Any

import numpy as np

import fifthwheel
from fifthwheel.base.arguments import expect, expect_each, expect_optional
from fifthwheel.base.errors import SignalError
from fifthwheel.base.names import NumberedName, ParameterPath, split_log
from fifthwheel.data.checks import Finding
from fifthwheel.data.record import Record
from fifthwheel.data.record.derived import estimate_noise_variance
from fifthwheel.estimate.design.predict import InformationPredictor, PredictedPosterior
from fifthwheel.estimate.design.remedies import PredictedRemedies, Remedy, lane_change_information
from fifthwheel.estimate.filters import variances
from fifthwheel.estimate.identify.dataset import LogData, prepare_dataset
from fifthwheel.estimate.identify.estimates import stated_estimates
from fifthwheel.estimate.identify.given import applied, with_sensors
from fifthwheel.estimate.identify.mass import mass_findings
from fifthwheel.estimate.identify.one_stage.prior import Earlier, nothing
from fifthwheel.estimate.identify.settings import OneStage
from fifthwheel.estimate.identify.statement import Statement, applies, statement, states_sigma
from fifthwheel.estimate.identify.verdict import Verdict, is_stated, straight_running
from fifthwheel.estimate.time_bases import check_signals
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.tyres import saturation_names
from fifthwheel.truck import Vehicle, unit_of
from fifthwheel.truck.quantities import size_of


@dataclass(frozen=True, kw_only=True)
class AssessmentSettings:
    """For which parameters remedies are searched, and which remedies are reported."""

    enough: float = 0.05
    """A parameter with at most this sigma, relative to its value, needs no remedy."""
    min_reduction: float = 0.15
    """A remedy must reduce sigma by at least this fraction."""
    max_remedies: int = 2
    """Maximum number of remedies for each parameter, of different kinds."""
    min_speed: float = 15.0
    """The lane change that is a remedy is driven at the median speed of the logs, but not below this speed, m/s."""


@dataclass(frozen=True, kw_only=True)
class ParameterAssessment:
    """One parameter before the fit; all sigmas are standard deviations in SI."""

    name: str
    value: float
    """Value of the vehicle file."""
    unit: str
    prior: float
    """Prior sigma."""
    sigma: float
    """Predicted sigma after the fit."""
    conditional_sigma: float | None = None
    """Predicted sigma if all other parameters were known; the sensors' errors remain unknown. None if it is STATED."""
    verdict: Verdict
    """CONVERGED if the logs contain enough information, else NOT_EXCITED or NOT_IDENTIFIABLE; STATED: of a number that
    is not estimated for itself, but stated with a standard deviation."""
    correlated_with: tuple[str, ...] = ()
    """Unknowns that can hardly be separated from this parameter, the worst first."""
    remedies: tuple[Remedy, ...] = ()

    @property
    def relative_sigma(self) -> float:
        """The predicted sigma as a fraction of the value; of a number that may be 0, of its prior sigma."""
        return self.sigma / size_of(self.name, self.value, self.prior)


@dataclass(frozen=True, kw_only=True)
class InformationAssessment:
    """The information in logs, predicted at the values of the vehicle file."""

    vehicle: str
    logs: tuple[str, ...]
    speed: float
    """Speed of the lane change that is a remedy, m/s."""
    findings: tuple[tuple[str, Finding], ...]
    """Log and finding of the signal checks, errors first."""
    parameters: tuple[ParameterAssessment, ...]
    sensors: Mapping[str, Mapping[str, float]]
    """Predicted sigma of the parameters, SI, with one more signal that would improve one of them, by signal, in the
    order of the mean reduction of the logarithm of sigma; of a parameter that would not be identifiable, the prior
    sigma."""
    noise: Mapping[str, Mapping[str, float]]
    """Assumed noise variance by log and channel, SI squared."""
    cautions: tuple[str, ...]
    """Reasons why the assessment itself may be wrong."""
    notes: tuple[str, ...]
    version: str

    def __getitem__(self, name: str) -> ParameterAssessment:
        """The assessment of a parameter by name; KeyError if it is not estimated."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        raise KeyError(name)

    def as_dict(self) -> dict[str, Any]:
        """The content for JSON."""
        findings = [
            {"log": log, "signal": f.signal, "fault": f.fault.value, "severity": f.severity, "message": f.message}
            for log, f in self.findings
        ]
        return asdict(self) | {"findings": findings}

    def to_json(self) -> str:
        """`as_dict` as JSON."""
        return json.dumps(self.as_dict(), indent=2)


def predict_sigmas(
    records: Sequence[Record],
    vehicle: Vehicle,
    settings: OneStage | None = None,
    assessment: AssessmentSettings | None = None,
    *,
    checked: bool = False,
    earlier: Earlier = nothing,
) -> InformationAssessment:
    """Assess the information that logs contain on a truck, before any fit.

    Computes the Cramer-Rao bound with priors at the values of the vehicle file: the better the file, the better the
    assessment. Model and logs are assumed to be right; errors of the model come in addition, and of faults in the logs
    only the findings are known. The noise of each channel is estimated from its spectral density between 3 and 10 Hz
    (`record.derived`), with a tenth of the variance of its sensor as the lower limit: that of `settings`, else the
    article's. This variance is used where a log is too short for the estimate, and where the noise is known.

    Args:
        records: logs that would be fitted together.
        vehicle: what is known of the truck.
        settings: settings of the fit; the output-error form is used, and the vehicle file's payload heights.
        assessment: which remedies are reported.
        checked: the signals of the logs have been checked for plausibility; there are no findings.
        earlier: the information of earlier logs on the unknowns of a setup, such as `Knowledge.prior` of an occasion.

    Raises:
        SignalError: a fit cannot use one of the logs; the message lists all findings.
        VehicleError: a statement of the settings cannot be used; or the truck is unstable at the speeds of the logs.

    Example:
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> record = fw.simulate(truck, count=1)
        >>> settings = fw.OneStage(given={"*": "exact", "tractor.front.cornering_stiffness": "free"}, tyres="linear")
        >>> assessment = fw.predict_sigmas([record], truck, settings)
        >>> [str(parameter.verdict) for parameter in assessment.parameters]
        ['converged']
    """
    expect_each("records", records, Record)
    expect("vehicle", vehicle, Vehicle)
    expect_optional("settings", settings, OneStage)
    vehicle, settings = applied(vehicle, settings or OneStage())
    assessment = assessment or AssessmentSettings()
    findings = [] if checked else [(r.name, finding) for r in records for finding in check_signals(r, vehicle)]
    findings += [] if checked else [(str(finding.log), finding) for finding in mass_findings(records, vehicle)]
    findings.sort(key=lambda item: item[1].severity)
    try:
        dataset = prepare_dataset(records, vehicle, settings, findings=False)
    except SignalError as error:
        raise SignalError("\n".join(dict.fromkeys([*[f.message for _, f in findings], str(error)]))) from error
    unused = [f"{s}: not used, because the tyres of the prediction are linear." for s in _on_tyres(vehicle, settings)]
    settings = with_sensors(dataset.vehicle, settings, dataset.sensors)
    speeds = np.concatenate([segment.input("speed") for log in dataset.logs for segment in log.segments])
    speed = max(float(np.median(speeds)), assessment.min_speed)
    predictor = InformationPredictor.of(
        dataset.vehicle, settings, [float(speeds.min()), float(speeds.max()), speed], dataset.outputs, earlier=earlier
    )
    logs = [replace(log, noise={**log.noise, **_noise_variances(predictor, log)}) for log in dataset.logs]
    runs = [predictor.run_information(log) for log in logs]
    of_logs = {log.name: {n: v * log.samples_per_row for n, v in log.noise.items()} for log in logs}  # of a sample
    noise = {name: variance for of_log in of_logs.values() for name, variance in of_log.items()}
    rate = records[0].rate
    lane_change = lane_change_information(predictor, speed=speed, rate=rate, noise=noise)
    posterior = predictor.posterior(runs)
    straight = straight_running(predictor.setup.estimated, dataset.lateral_accelerations(settings.min_speed))
    posterior = replace(posterior, not_identified={**straight, **posterior.not_identified})
    remedies = PredictedRemedies.of(predictor, runs, lane_change)
    names, setup = tuple(record.name for record in records), predictor.setup
    z = np.zeros(len(posterior.names))
    stated = [
        ParameterAssessment(
            name=e.name, value=e.value, unit=e.unit, prior=e.prior or 0.0, sigma=e.sigma or 0.0, verdict=Verdict.STATED
        )
        for e in stated_estimates(setup, posterior, z, names, dataset.sensors)
        if states_sigma(settings.given, split_log(e.name)[0])
    ]
    return InformationAssessment(
        vehicle=vehicle.name,
        logs=names,
        speed=speed,
        findings=tuple(findings),
        parameters=(
            *[_assess_parameter(predictor, name, posterior, remedies, assessment, names) for name in setup.estimated],
            *stated,
        ),
        sensors=_sensors(predictor, posterior, remedies, assessment),
        noise={log: {n: of_log[n] for n in setup.outputs if n in of_log} for log, of_log in of_logs.items()},
        cautions=(_unstable_caution(predictor),) if predictor.start else (),
        notes=(*dataset.notes, *unused),
        version=fifthwheel.__version__,
    )


def _assess_parameter(
    predictor: InformationPredictor,
    name: str,
    posterior: PredictedPosterior,
    remedies: PredictedRemedies,
    assessment: AssessmentSettings,
    logs: Sequence[str],
) -> ParameterAssessment:
    vehicle = predictor.setup.vehicle
    value, prior, verdict = vehicle.parameters()[name], predictor.prior_sigma(name), posterior.verdict(name)
    if verdict is not Verdict.CONVERGED and is_stated(vehicle, name):
        verdict = Verdict.STATED
    sigma, target = posterior.sigma_of(name) * prior, assessment.enough * size_of(name, value, prior)
    if verdict is Verdict.CONVERGED and sigma <= target:
        best: tuple[Remedy, ...] = ()
    else:
        best = remedies.best(
            name,
            posterior.reliable_sigma(name) * prior,
            target=target,
            min_reduction=assessment.min_reduction,
            max_count=assessment.max_remedies,
        )
    return ParameterAssessment(
        name=name,
        value=value,
        unit=unit_of(name),
        prior=prior,
        sigma=sigma,
        conditional_sigma=posterior.conditional_sigma(name) * prior,
        verdict=verdict,
        correlated_with=tuple(_with_log_name(other, logs) for other in posterior.correlated_with(name)),
        remedies=best,
    )


def _on_tyres(vehicle: Vehicle, settings: OneStage) -> list[Statement]:
    """The statements on tyres that saturate and on the friction of the road."""
    names, own = saturation_names(vehicle.group_paths()), vehicle.parameters()
    found = [s for s in starmap(statement, settings.given.items()) if s.kind != "exact"]
    return [s for s in found if any(applies(s, n) for n in names) and not any(applies(s, path) for path in own)]


def _sensors(
    predictor: InformationPredictor,
    posterior: PredictedPosterior,
    remedies: PredictedRemedies,
    assessment: AssessmentSettings,
) -> dict[str, dict[str, float]]:
    """Each signal that is not logged and would improve a parameter, with the sigma of every parameter, SI."""
    names = predictor.setup.estimated
    before = np.array([posterior.reliable_sigma(name) for name in names])
    sigmas = {r.channel: np.array(list(map(after.reliable_sigma, names))) for r, after in remedies.single if r.channel}
    useful = {c: after for c, after in sigmas.items() if (after <= (1 - assessment.min_reduction) * before).any()}
    prior = np.array(list(map(predictor.prior_sigma, names)))
    return {
        channel: dict(zip(names, (useful[channel] * prior).tolist(), strict=True))
        for channel in sorted(useful, key=lambda channel: float(np.log(useful[channel]).sum()))
    }


def _with_log_name(name: str, logs: Sequence[str]) -> str:
    """An unknown's name with the name of its log instead of the log's number."""
    base, log, _ = NumberedName.of(name)
    return base if log is None else f"{base}@{logs[log]}"


def _noise_variances(predictor: InformationPredictor, log: LogData) -> dict[str, float]:
    """Noise variance of each channel that a log has, SI squared."""
    result, setup = {}, predictor.setup
    for name in setup.outputs:
        segments = [s for s in log.segments if name in s.signals and np.isfinite(s.signals[name]).any()]
        if not segments:
            continue
        default = variances.sensor_variance(setup.vehicle, name, setup.settings.noise) / log.samples_per_row
        if not setup.settings.adapt_noise:
            result[name] = default
            continue
        estimates = [(len(s), estimate_noise_variance(s.time, s.signals[name])) for s in segments]
        available = [(size, variance) for size, variance in estimates if variance is not None]
        weights, values = [size for size, _ in available], [variance for _, variance in available]
        mean = float(np.average(values, weights=weights)) if available else default
        result[name] = max(mean, default / 10)
    return result


def _unstable_caution(predictor: InformationPredictor) -> str:
    vehicle, first = predictor.setup.vehicle, next(iter(predictor.start))
    axles = " and ".join(ParameterPath.of(name).owner for name in predictor.start)
    factor = predictor.start_vehicle.parameters()[first] / vehicle.parameters()[first]
    critical_speed = dynamics.critical_speed(vehicle) or float("nan")
    return (
        f"{vehicle.name}: with the values of its file unstable from {3.6 * critical_speed:.0f} km/h; check the file. "
        f"This assessment uses {factor:.2g} times the cornering stiffness of {axles}, where a fit would start."
    )
