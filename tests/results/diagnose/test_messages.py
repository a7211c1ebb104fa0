"""The order of cautions: causes first, what they explain apart."""

import pytest

from fifthwheel.data.checks import Fault, Finding
from fifthwheel.estimate.identify.doubts import Cause, Doubt, DoubtKind
from fifthwheel.results.diagnose import Caution, CautionKind, ranked
from fifthwheel.results.diagnose.cautions import signal_cautions

YAW2, ROLL2 = "yaw_rate.semitrailer", "roll_rate.semitrailer"


def caution(kind, *signals, severity="warning"):
    return Caution(kind, f"{kind}.", "Check.", 1.0, signals=signals, severity=severity)


def doubt(*names):
    causes = tuple(Cause(name=name, changes={}, prior_sigmas=9.0) for name in names)
    return Doubt(kind=DoubtKind.ASSUMPTION, causes=causes, parameters=(), statistic=9.0)


def kinds(cautions):
    return [c.kind for c in cautions]


FIT = caution(CautionKind.POOR_FIT, YAW2)
ASSUMPTION = caution(CautionKind.ASSUMPTION)
DELAY = caution(CautionKind.DELAY, YAW2, ROLL2)


def test_a_fault_of_a_signal_explains_all_else():
    first = caution(CautionKind.SIGNAL, YAW2)
    causes, effects = ranked([FIT, ASSUMPTION, DELAY, first], [doubt("semitrailer.mass")])
    assert kinds(causes) == [CautionKind.SIGNAL]
    assert kinds(effects) == [CautionKind.POOR_FIT, CautionKind.ASSUMPTION, CautionKind.DELAY]


@pytest.mark.parametrize("cause", [f"{ROLL2}.delay", f"{ROLL2}.delay@1"])
def test_a_delay_that_the_fits_confirm_is_the_cause(cause):
    causes, effects = ranked([FIT, ASSUMPTION, DELAY], [doubt(cause)])
    assert (kinds(causes), kinds(effects)) == ([CautionKind.DELAY], [CautionKind.POOR_FIT, CautionKind.ASSUMPTION])


@pytest.mark.parametrize("cause", ["semitrailer.mass", f"{ROLL2}.misalignment", "yaw_rate.tractor.delay"])
def test_a_delay_that_the_fits_do_not_confirm_is_an_effect(cause):
    causes, effects = ranked([FIT, ASSUMPTION, DELAY], [doubt(cause)])
    assert (kinds(causes), kinds(effects)) == ([CautionKind.ASSUMPTION], [CautionKind.POOR_FIT, CautionKind.DELAY])


def test_effects_without_a_cause_are_shown_and_errors_come_first():
    lift, error = caution(CautionKind.WHEEL_LIFT), caution(CautionKind.UNRELATED_CHANNEL, severity="error")
    assert ranked([FIT, lift]) == ([lift, FIT], [])
    causes, effects = ranked([FIT, caution(CautionKind.SIGNAL), error])
    assert (kinds(causes), effects) == ([CautionKind.UNRELATED_CHANNEL, CautionKind.SIGNAL], [FIT])
    assert ranked([]) == ([], [])


def test_one_fault_of_several_logs_is_one_caution_and_what_is_repaired_is_none():
    def finding(fault, log):
        return Finding(signal=YAW2, fault=fault, severity="warning", message=f"{YAW2}: {fault}", log=log)

    faults = [finding(Fault.DUPLICATE, "a"), finding(Fault.SPIKE, "a"), finding(Fault.DUPLICATE, "b")]
    (found,) = signal_cautions(faults)
    assert str(found) == f"a and b: {YAW2}: duplicate."
    assert (found.kind, found.signals, found.log) == (CautionKind.SIGNAL, (YAW2,), None)
    (found,) = signal_cautions([finding(Fault.TIME_OFFSET, "a")])
    assert (found.kind, found.log) == (CautionKind.DELAY, "a")
