"""Results of an identification of which each verdict, sigma and log is chosen."""

from dataclasses import replace

from fifthwheel.estimate.design.assess import InformationAssessment, ParameterAssessment
from fifthwheel.estimate.identify import Estimate
from fifthwheel.estimate.identify.verdict import Verdict

FRONT, REAR = "tractor.front.cornering_stiffness", "semitrailer.cornering_stiffness"
INERTIA, HEIGHT = "semitrailer.yaw_inertia", "semitrailer.payload.height"
AXIS, SOFTENING = "semitrailer.roll_axis_height", "tractor.softening"
UNITS = {FRONT: "N/rad", REAR: "N/rad", INERTIA: "kg m^2", HEIGHT: "m", AXIS: "m"}


def estimate(name, verdict=Verdict.CONVERGED, *, sigma=0.01, **others):
    defaults = {"value": 1.0, "initial": 1.0, "stage": 1, "prior": 0.3, "unit": UNITS[name]}
    return Estimate(name=name, verdict=verdict, sigma=sigma, **(defaults | others))


def of(result, *estimates, **others):
    """A result with these parameters, and nothing else to say."""
    fits = tuple(fit for fit in result.identification.fits if fit.identified_on)
    nothing = {
        "fits": fits,
        "variance_budget": {},
        "remaining_uncertainty": {},
        "uncertain": (),
        "sensors": (),
        "doubts": (),
    }
    return replace(result.identification, parameters=estimates, **(nothing | others))


def outlook(*assessments):
    return InformationAssessment(
        vehicle="a", logs=("a",), speed=25.0, findings=(), parameters=assessments, sensors={}, noise={}, cautions=(),
        notes=(), version="",
    )  # fmt: skip


def assessment(name, *remedies, sigma=0.1, verdict=Verdict.CONVERGED, value=2.0):
    return ParameterAssessment(
        name=name, value=value, unit="1", prior=0.3, sigma=sigma, conditional_sigma=0.1, verdict=verdict,
        correlated_with=(), remedies=remedies,
    )  # fmt: skip
