"""All findings on a record: those of `checks`, and time offsets, clocks and exchanged gyros by the model."""

from collections.abc import Iterator, Mapping, Sequence

from fifthwheel.channels import YAW_RATE, is_input, is_of
from fifthwheel.checks import Fault, Finding, check
from fifthwheel.checks.findings import remedy_text
from fifthwheel.record import Record
from fifthwheel.time_bases.exchanged import exchanged_pairs
from fifthwheel.time_bases.offsets import TimeOffset, common_offsets, offsets_of
from fifthwheel.time_bases.predictions import Prediction, predict_channels
from fifthwheel.time_bases.rates import ClockRate, channel_rates, common_rates
from fifthwheel.vehicle import Vehicle

_BY_TIME = (Fault.SWAPPED_SIGN, Fault.WRONG_COLUMN)
"""Faults that a time offset or an exchange of channels can be taken for."""
_WELL_EXPLAINED = 0.8
"""Fraction of the variance from which a channel with a corrected offset is neither wrong nor inverted."""


def check_record(record: Record, vehicle: Vehicle | None = None) -> tuple[Finding, ...]:
    """Every fault of a record, errors first; with the vehicle also signals that it does not have.

    Time offsets, clock rates and exchanged gyros are looked for if no other error explains the signals. What they
    explain is not reported as a wrong column or sign.

    Example:
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> record = fw.simulate(truck, count=1)
        >>> inverted = record.with_signals({"yaw_rate.tractor": -record.signals["yaw_rate.tractor"]})
        >>> [finding.signal for finding in fw.check_record(inverted, truck)]
        ['yaw_rate.tractor']
    """
    if vehicle is None:
        findings = check(record)
    else:
        units = [unit.name for unit in vehicle.units]
        findings = check(record, wheelbase=vehicle.wheelbase, units=units, steered=vehicle.steer_signals())
    if any(finding.severity == "error" and finding.fault not in _BY_TIME for finding in findings):
        return findings
    prediction = predict_channels(record, vehicle)
    if prediction is None:
        return findings
    offsets = offsets_of(record, prediction)
    found = list(time_base_findings(record, prediction, offsets))
    explained = {name for finding in found for name in (finding.signal, *finding.others)}
    well = {o.name for o in offsets if o.explained > _WELL_EXPLAINED}
    if found and well:  # then speed and steer angle are right too, and so is the reference of the offsets
        explained |= well | {name for name in record.signals if is_input(name)} | {prediction.leading}
    kept = [finding for finding in findings if not (finding.fault in _BY_TIME and finding.signal in explained)]
    return tuple(sorted([*kept, *found], key=lambda finding: finding.severity))


def time_base_findings(record: Record, prediction: Prediction, offsets: Sequence[TimeOffset]) -> Iterator[Finding]:
    """Findings by a prediction of the channels: exchanged gyros, else clock rates and time offsets."""
    exchanged = list(exchanged_pairs(prediction))
    for front, rear in exchanged:
        is_yaw = is_of(rear, YAW_RATE)
        yield Finding(
            signal=rear,
            fault=Fault.EXCHANGED,
            severity="error" if is_yaw else "warning",
            message=f"{rear}: follows the motion expected of {front}, and {front} that of {rear}; exchange the columns "
            "of both in signals.toml",
            others=(front,),
        )
    if exchanged:
        return
    rates = list(channel_rates(prediction))
    drifting = {name for rate in rates for name in rate.signals}
    if rates:
        yield _drift_finding(rates)
    for rate in common_rates(prediction):
        if not drifting:
            yield _common_rate_finding(rate)
    for offset in common_offsets([o for o in offsets if not drifting & set(o.signals)]):
        yield _offset_finding(offset, record.time_bases)


def _offset_finding(offset: TimeOffset, time_bases: Mapping[str, str]) -> Finding:
    """One finding on all signals with a common offset."""
    signal, *others = offset.signals
    delay = round(offset.offset, 2)
    base = f" ({time_bases[signal]})" if len({time_bases.get(name) for name in offset.signals} - {None}) == 1 else ""
    late = f"{abs(delay):.2f} s {'late' if delay > 0 else 'early'}{base}, with a sigma of {offset.sigma:.2f} s"
    cure = remedy_text({"delay": delay})
    if others:
        late, cure = f"{late}, like {', '.join(others)}", f"{cure} for each of them"
    return Finding(
        signal=signal,
        fault=Fault.TIME_OFFSET,
        severity="warning",
        message=f"{signal}: {late}; {cure}, more if it has a delay already",
        remedy={"delay": delay},
        others=tuple(others),
    )


def _drift_finding(rates: Sequence[ClockRate]) -> Finding:
    """One finding on all channels whose clock drifts."""
    signal, *others = (name for rate in rates for name in rate.signals)
    mean = sum(rate.rate for rate in rates) / len(rates)
    like = f", like that of {', '.join(others)}" if others else ""
    return Finding(
        signal=signal,
        fault=Fault.CLOCK_RATE,
        severity="warning",
        message=f"{signal}: its clock runs {abs(mean):.1%} {'fast' if mean > 0 else 'slow'} against that of the steer "
        f"angle{like}; correct the timestamps of this logger, no delay in signals.toml can",
        others=tuple(others),
    )


def _common_rate_finding(rate: ClockRate) -> Finding:
    more = "more" if rate.rate > 0 else "less"
    return Finding(
        signal="time",
        fault=Fault.CLOCK_RATE,
        severity="warning",
        message=f"time: {abs(rate.rate):.1%} {more} than yaw rates and articulation angle agree with, with a sigma of "
        f"{rate.sigma:.1%}; correct the unit or the rate of the time, or the gain of a yaw rate, in signals.toml",
    )
