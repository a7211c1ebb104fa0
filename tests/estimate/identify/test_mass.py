"""Gross mass, and mass and CoG of the load, from axle loads and weights: statics of drawn trucks, closed forms."""

import math

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.apps.workflow.measured_vehicle import drive_vehicle
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.data.channels.sensors import SensorPrior
from fifthwheel.data.checks import check
from fifthwheel.data.checks.axle_loads import mean_weights
from fifthwheel.estimate.identify.mass import mass_findings
from fifthwheel.model.plant.powered import DrivenTruck, drive
from fifthwheel.truck.loads import axle_loads
from fifthwheel.truck.uncertainty import changes

TRUCK = fw.vehicle("cheng_cebon_2011")
GROSS = sum(unit.mass for unit in TRUCK.units)


def parked(signals, *, gains=None):
    """One minute at rest with constant weights, N."""
    sensors = {name: SensorPrior(errors={"gain": (1.0, sigma)}) for name, sigma in (gains or {}).items()}
    values = {name: np.full(60, value) for name, value in signals.items()}
    return fw.Record(time=np.arange(60.0), signals=values, sensors=sensors, name="parked")


def loads_of(vehicle):
    return {f"axle_load.{path}": load for path, load in vehicle.axle_loads().items()}


def test_errors_of_mass_and_cog_have_their_sigma():
    """Trucks that differ from their file by its uncertainty, with another load, and loads with errors of 2 %."""
    rng = np.random.default_rng(1)
    errors = []
    for _ in range(60):
        values = dict(TRUCK.parameters())
        for change in changes(TRUCK):
            size = rng.normal()
            for path, slope in change.slopes.items():
                values[path] += size * slope
        load = rng.uniform(-15e3, 5e3)
        values["semitrailer.mass"] += load
        values["semitrailer.cog"] += 0.5 * load / values["semitrailer.mass"] * rng.normal()
        exact = axle_loads(values, TRUCK.units, TRUCK.couplings)
        loads = {f"axle_load.{path}": load * (1 + 0.02 * rng.normal()) for path, load in exact.items()}
        result = fw.gross_mass([parked(loads)], TRUCK)
        assert result.verdict is fw.Verdict.CONVERGED
        of_units = [(mean - values[path]) / sigma for path, (mean, sigma) in result.units.items()]
        errors.append([(result.mass - values["tractor.mass"] - values["semitrailer.mass"]) / result.sigma, *of_units])
    assert np.sqrt(np.mean(np.square(errors), axis=0)) == pytest.approx([1.0, 1.0, 1.0], abs=0.25)


def test_the_sigma_of_all_axle_loads_is_that_of_their_sum():
    loads = loads_of(TRUCK)
    result = fw.gross_mass([parked(loads)], TRUCK)
    assert result.mass == pytest.approx(GROSS, rel=1e-6)
    assert result.sigma == pytest.approx(0.02 * math.hypot(*loads.values()) / STANDARD_GRAVITY, rel=0.1)
    assert result.sigma == pytest.approx(math.hypot(*result.parts.values()))
    of_units = {"tractor": loads["axle_load.tractor.front"] + loads["axle_load.tractor.drive"]}
    of_units["semitrailer"] = loads["axle_load.semitrailer"]
    result = fw.gross_mass([parked({f"axle_load.{unit}": load for unit, load in of_units.items()})], TRUCK)
    assert result.mass == pytest.approx(GROSS, rel=1e-6)
    assert result.units["semitrailer.cog"][0] == pytest.approx(TRUCK.units[1].cog, abs=1e-4)


def test_bellow_pressures_with_a_calibration_are_an_axle_load(tmp_path):
    """Both sides with half of 7500 kg at 340 kPa, half way between the weighed loads; sigma is that of the gain."""
    sides = [f"ASC4.rear_axle_{side}_bellow_pressure@2F" for side in ("left", "right")]
    rows = [f"{t},340,340" for t in range(60)]
    (tmp_path / "a.csv").write_text("\n".join([",".join(["t", *sides]), *rows]))
    signals = fw.SignalMap.parse(f"""
        [signals."axle_load.tractor.drive"]
        sum = ["{sides[0]}", "{sides[1]}"]
        unit = "kg"
        points = [[120, 1900], [560, 5600]]
        gain = "1 +- 3 %"
    """)
    (name, load), *others = mean_weights([fw.read_log(tmp_path / "a.csv", signals)]).items()
    assert (name, others) == ("axle_load.tractor.drive", [])
    assert np.array(load) / STANDARD_GRAVITY == pytest.approx([7500, 0.03 * 7500])


def test_driving_and_a_gross_weight_are_weighted_by_their_information():
    record = drive(DrivenTruck(mass=26e3), duration=120.0, seed=5)
    weight = np.full(len(record), 26.5e3 * STANDARD_GRAVITY)
    driven, weighed, both = (
        fw.gross_mass([r], TRUCK)
        for r in (record, parked({"gross_weight": weight[0]}), record.with_signals({"gross_weight": weight}))
    )
    assert weighed.sigma == pytest.approx(0.05 * 26.5e3)
    information = driven.sigma**-2 + weighed.sigma**-2
    assert both.sigma == pytest.approx(information**-0.5, rel=1e-3)
    mean = (driven.mass / driven.sigma**2 + weighed.mass / weighed.sigma**2) / information
    assert both.mass == pytest.approx(mean, rel=1e-4)
    assert both.sources["driving"] == (pytest.approx(driven.mass), pytest.approx(driven.sigma))


@pytest.mark.slow
def test_driving_that_contradicts_the_loads_is_refused_and_found():
    record = drive(DrivenTruck(mass=26e3), duration=120.0, seed=5)
    loads = {name: np.full(len(record), load) for name, load in loads_of(TRUCK).items()}
    record = record.with_signals(loads)
    result = fw.gross_mass([record], TRUCK)
    assert result.verdict is fw.Verdict.DOUBTFUL
    with pytest.raises(fw.SignalError, match=r"drive: the gross mass is 2\d.* by driving, and 40\.6.* by axle loads"):
        drive_vehicle([record], TRUCK.to_toml())
    (finding,) = mass_findings([record], TRUCK)
    assert finding.fault == "mass"
    assert "correct the scales in [driveline]" in finding.message


def test_exchanged_loads_are_refused():
    loads = TRUCK.axle_loads()
    exchanged = {"front": loads["tractor.drive"], "drive": loads["tractor.front"]}
    signals = {f"axle_load.tractor.{name}": load for name, load in exchanged.items()}
    record = parked(signals | {"axle_load.semitrailer": loads["semitrailer"]})
    assert fw.gross_mass([record], TRUCK).verdict is fw.Verdict.DOUBTFUL
    with pytest.raises(fw.SignalError, match=r"parked: axle_load\.tractor\.\w+ differs by \d+\.\d sigma .* exchanged"):
        drive_vehicle([record], TRUCK.to_toml())


def test_a_parked_truck_with_all_signals_has_the_mass_of_its_loads():
    """It does not drive: only the loads count."""
    still = {"speed": 0.0, "engine_speed": 60.0, "engine_torque": 200.0, "braking.tractor": 1.0}
    result = fw.gross_mass([parked(loads_of(TRUCK) | still)], TRUCK)
    assert result.sources.keys() == {"weights"}
    assert result.used == 0


def test_a_stated_gain_replaces_the_usual_error_of_a_scale():
    signals = {"gross_weight": GROSS * STANDARD_GRAVITY}
    result = fw.gross_mass([parked(signals, gains={"gross_weight": 0.01})], TRUCK)
    assert result.sigma == pytest.approx(0.01 * GROSS, rel=1e-4)
    other = parked(signals)
    with pytest.raises(fw.SignalError, match="gross_weight: expected one gain in all logs"):
        fw.gross_mass([parked(signals, gains={"gross_weight": 0.01}), other], TRUCK)


def test_a_weight_that_cannot_be_used_is_refused():
    for signals, message in (
        (
            {"axle_load.dolly": 5e4},
            r"axle_load\.dolly: .* has no dolly; it has semitrailer, tractor, tractor\.drive, tr",
        ),
        ({"weight.semitrailer.rear": 5e4}, r"weight\.semitrailer\.rear: .* has no semitrailer\.rear"),
        ({"gross_weight": -5e4}, r"gross_weight: expected above 0 N, got -50000 N; check column and unit"),
        ({"gross_weight": np.nan}, r"gross_weight: 0 samples at rest or driving straight, at least 5 expected"),
    ):
        with pytest.raises(fw.SignalError, match=message):
            fw.gross_mass([parked(signals)], TRUCK)


def test_the_file_has_the_load_and_its_cog():
    other = fw.with_payload(TRUCK, 12e3, cog=-5.2)
    driven = drive_vehicle([parked(loads_of(other), gains=dict.fromkeys(loads_of(other), 1e-4))], TRUCK.to_toml())
    new, trailer = driven.vehicle.parameters(), driven.vehicle.units[1]
    assert trailer.mass == pytest.approx(other.units[1].mass, rel=0.01)
    assert driven.vehicle.stated["semitrailer.cog"] < 0.15
    assert abs(trailer.cog + 5.2) < 2.5 * driven.vehicle.stated["semitrailer.cog"]
    assert driven.changed["semitrailer.cog"]["before"] == -5.49
    assert new["semitrailer.yaw_inertia"] / TRUCK.units[1].yaw_inertia == pytest.approx(trailer.mass / 33450, rel=1e-4)
    assert new["semitrailer.cornering_stiffness"] == pytest.approx(
        other.parameters()["semitrailer.cornering_stiffness"], rel=0.02
    )


def test_weights_that_are_sent_every_10_s_have_no_gaps():
    record = fw.simulate(TRUCK, manoeuvre="straight", duration=60)
    weight = np.where(np.arange(len(record)) % 1000 == 0, GROSS * STANDARD_GRAVITY, np.nan)
    assert "gross_weight" not in {finding.signal for finding in check(record.with_signals({"gross_weight": weight}))}
