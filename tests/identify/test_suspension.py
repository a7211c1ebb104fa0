"""The suspension from a log with a known payload, carried to a log with an unknown one."""

from dataclasses import replace

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.errors import SignalError, VehicleError
from fifthwheel.identify import Identification, OneStage
from fifthwheel.identify.suspension import with_suspension
from fifthwheel.identify.unknowns.parameters import one_stage_unknowns
from fifthwheel.identify.verdict import Verdict
from fifthwheel.vehicle import Vehicle

HEIGHT, STIFFNESS = "semitrailer.payload.height", "semitrailer.roll_stiffness"
OUTPUTS = ("yaw_rate.tractor", "yaw_rate.semitrailer", "roll_rate.tractor", "roll_rate.semitrailer")
KNOWN = OneStage(fixed=(HEIGHT,), priors={STIFFNESS: 0.1})


@pytest.fixture(scope="module")
def assumed(truck: Vehicle) -> Vehicle:
    """The truck with a suspension in its file that is stiffer than the real one, at a higher roll axis."""
    values = truck.parameters()
    return truck.replace({STIFFNESS: 1.12 * values[STIFFNESS], "semitrailer.roll_axis_height": 0.88})


@pytest.fixture(scope="module")
def reference(truck: Vehicle, assumed: Vehicle) -> Identification:
    """By a log with the same payload mass, but a height of 0.8 m, which is known."""
    low = fw.simulate(truck.replace({HEIGHT: 0.8}), count=1, seed=3)
    return fw.identify([low], assumed.replace({HEIGHT: 0.8}), KNOWN)


def test_a_known_payload_makes_the_next_payload_height_more_accurate(
    truck: Vehicle, assumed: Vehicle, reference: Identification
) -> None:
    record, true = fw.simulate(truck, count=1, seed=4), truck.parameters()[HEIGHT]
    alone = fw.identify([record], assumed)[HEIGHT]
    calibrated, settings = with_suspension(assumed, OneStage(), reference)
    result = fw.identify([record], calibrated, settings)
    assert abs(alone.value / true - 1) > 0.1
    assert abs(result[HEIGHT].value / true - 1) < 0.08
    assert result[HEIGHT].sigma < 0.7 * alone.sigma
    assert result[HEIGHT].verdict == "converged"


def test_the_changes_have_the_covariance_of_the_identification(assumed: Vehicle, reference: Identification) -> None:
    vehicle, settings = with_suspension(assumed, OneStage(), reference)
    names = [change.name for change in settings.changes]
    assert {STIFFNESS, "semitrailer.roll_axis_height"} < set(names)
    assert HEIGHT not in names
    assert vehicle.parameters()[STIFFNESS] == reference.vehicle.parameters()[STIFFNESS]
    columns = np.array([[change.slopes[name] for name in names] for change in settings.changes]).T
    assert reference.covariance is not None
    joint = reference.covariance.among(names)
    assert joint.names == tuple(names)
    scale = np.sqrt(np.diag(joint.covariance))
    np.testing.assert_allclose(
        columns @ columns.T / np.outer(scale, scale), joint.covariance / np.outer(scale, scale), atol=1e-9
    )


def test_changes_replace_the_uncertainty_of_the_parameters_that_they_alter(
    assumed: Vehicle, reference: Identification
) -> None:
    stated = assumed.with_stated({"tractor.roll_axis_height": 0.01})
    vehicle, settings = with_suspension(stated, OneStage(), reference)
    unknowns = one_stage_unknowns(vehicle, OUTPUTS, settings)
    assert sorted({u.name for u in unknowns}) == sorted(u.name for u in unknowns)
    altering = [u for u in unknowns if STIFFNESS in u.slopes]
    assert len(altering) == len(settings.changes)
    variance = sum((u.slopes[STIFFNESS] * u.scale) ** 2 for u in altering)
    assert reference.covariance is not None
    assert variance == pytest.approx(reference.covariance.among([STIFFNESS]).covariance[0, 0], rel=1e-6)


def test_settings_with_changes_are_stored(tmp_path, assumed: Vehicle, reference: Identification) -> None:
    _, settings = with_suspension(assumed, OneStage(), reference)
    replace(reference, settings=settings).save(tmp_path)
    assert Identification.load(tmp_path / "identification.json").settings == settings


def test_unsuitable_identifications_are_refused(truck: Vehicle, reference: Identification) -> None:
    with pytest.raises(SignalError, match="identify it in one stage"):
        with_suspension(truck, OneStage(), replace(reference, covariance=None))
    with pytest.raises(SignalError, match="leave out --any-load"):
        with_suspension(truck, OneStage(uniform_payload=False), reference)
    failed = tuple(replace(estimate, verdict=Verdict.NOT_CONVERGED) for estimate in reference.parameters)
    with pytest.raises(SignalError, match="did not converge"):
        with_suspension(truck, OneStage(), replace(reference, parameters=failed))
    with pytest.raises(VehicleError, match="use the same names"):
        with_suspension(Vehicle(name="alone", units=truck.units[:1]), OneStage(), reference)
