"""The rough road: its spectrum and correlation by closed forms, wheel loads by linear models of an axle and a body."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import block_diag

from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.model.manoeuvres import straight
from fifthwheel.model.plant import Plant, Properties
from fifthwheel.model.plant.bodies import sprung_bodies
from fifthwheel.model.plant.powered import STEPS_PER_COMMAND, TIME_STEP
from fifthwheel.model.plant.properties import ROAD_CLASSES, with_changes
from fifthwheel.model.plant.rough_road import BAND, COUNT, LEAD, STEP, RoughRoad, tracks
from fifthwheel.model.plant.truck import SETTLING_TIME
from fifthwheel.truck import Vehicle, get
from tests.model.plant.golden_car import gain, roughness_index
from tests.results.assess.trucks import single_axles

TRUCK = get("cheng_cebon_2011")
B, TRACK = ROAD_CLASSES["B"], 2.0
CLASSES = (ROAD_CLASSES["A"], B, ROAD_CLASSES["C"])
NO_RESISTANCE = Properties(drag_area=0.0, rolling_resistance=0.0)


def ratio_of_an_isotropic_surface(n: float, distance: float) -> float:
    """Cross density over density, by the two-dimensional spectrum (n^2 + m^2)^(-3/2) along the line of the tracks."""

    def spectrum(m: float) -> float:
        return float((n**2 + m**2) ** -1.5)

    cross, _ = quad(spectrum, 0, np.inf, weight="cos", wvar=2 * np.pi * distance)
    return float(cross / quad(spectrum, 0, np.inf)[0])


def test_spectrum_and_correlation_of_both_tracks() -> None:
    """Means over a third of an octave: the density of ISO 8608 within 2 %, and the ratio of an isotropic surface."""
    height, _ = tracks(B, TRACK, seed=1)
    left, right = np.fft.rfft(height) / COUNT
    n = np.fft.rfftfreq(COUNT, STEP)
    for low in (0.03, 0.1, 0.3, 1.0, 2.0):
        band = (n >= low) & (n < 1.26 * low)
        expected = B * (n[band] / 0.1) ** -2 / (STEP * COUNT)
        for side in (left, right):
            assert np.mean(2 * np.abs(side[band]) ** 2 / expected) == pytest.approx(1.0, abs=0.1)
        both = np.abs(left[band]) ** 2 + np.abs(right[band]) ** 2
        assert np.mean(both / expected) == pytest.approx(1.0, abs=1e-9)
        cross = np.mean(2 * (left[band] * right[band].conj()).real / expected)
        assert cross == pytest.approx(ratio_of_an_isotropic_surface(float(n[band].mean()), TRACK), abs=0.02)
    outside = (n < BAND[0]) | (n > BAND[1])
    assert np.abs(left[outside]).max() < 1e-12 * np.abs(left).max()


def test_a_seed_is_a_road() -> None:
    first = tracks(B, TRACK, seed=1)
    np.testing.assert_array_equal(first, tracks(B, TRACK, seed=1))
    assert abs(np.corrcoef(first[0, 0], tracks(B, TRACK, seed=2)[0, 0])[0, 1]) < 0.1
    np.testing.assert_allclose(2 * first, tracks(4 * B, TRACK, seed=1))


def test_the_roughness_index_of_a_class() -> None:
    """The golden car on both tracks, and its gain by the spectrum: 2.2, 4.3 and 8.7 m/km for A, B and C."""
    n = np.linspace(*BAND, 5000)
    for roughness, rounded in zip(CLASSES, (2.2, 4.3, 8.7), strict=True):
        height, _ = tracks(roughness, TRACK, seed=3)
        density = gain(n) ** 2 * roughness * (n / 0.1) ** -2
        expected = 1e3 * np.sqrt(2 / np.pi * np.trapezoid(density, n))
        assert expected == pytest.approx(rounded, abs=0.05)
        assert [roughness_index(side, STEP) for side in height] == pytest.approx([expected] * 2, rel=0.01)


def test_wheels_of_a_side_pass_the_same_road_one_after_the_other() -> None:
    road, speed, behind = RoughRoad(B, TRACK, np.array([0.0, -5.0]), seed=1), 25.0, 200  # time steps of 5 m
    rows = np.concatenate([road.ahead(speed, TIME_STEP, STEPS_PER_COMMAND) for _ in range(200)])
    height, rate = np.split(rows, 2, axis=1)
    rough = slice(round(LEAD / speed / TIME_STEP), None)
    first, second = height[rough, :2], height[rough, 2:]
    np.testing.assert_allclose(second[behind:], first[:-behind], atol=1e-12)
    assert not np.allclose(first[:, 0], first[:, 1])
    assert not height[0].any()
    for k in (slice(20, 380), slice(420, None)):  # while it becomes rough, and later
        slope = np.gradient(height[:, 0], TIME_STEP)
        assert np.std(slope[k] - rate[k, 0]) < 0.06 * np.std(rate[k, 0])


def tractor() -> Vehicle:
    """The tractor alone: a body on two axles."""
    fields = single_axles().model_dump()
    return Vehicle(**fields | {"units": fields["units"][:1], "couplings": [], "stated": {}})


def half_car(frequency: np.ndarray, properties: Properties) -> np.ndarray:
    """Complex load of an axle per height of the road below both its wheels, N/m, (frequencies, 2 loads, 2 heights).

    Heave and pitch of the body of the tractor, heave of both axles. Without longitudinal forces the CoG of body and
    axles stays: the axles add to the pitch inertia, and gravity acts on the body over them.
    """
    body = sprung_bodies(tractor(), properties)[0]
    x = np.array([axle.x - body.cog[0] for axle in body.axles])
    over, unsprung = body.cog[1] - properties.wheel_radius, sum(axle.mass for axle in body.axles)
    pitch_inertia = body.inertia[1] + over**2 * body.mass * unsprung / (body.mass + unsprung)
    mass = np.diag([body.mass, pitch_inertia, *(axle.mass for axle in body.axles)])
    gravity = np.diag([0.0, body.mass * GRAVITY * over, 0.0, 0.0])
    springs = np.hstack([-np.column_stack([np.ones(2), -x]), np.eye(2)])  # deflection by heave, pitch and both axles
    gains = []
    for s in 2j * np.pi * frequency:
        spring = np.diag([axle.vertical_stiffness + axle.vertical_damping * s for axle in body.axles])
        tyre = np.diag([2 * (a.tyre_stiffness + a.tyres_per_side * properties.tyre_damping * s) for a in body.axles])
        below = np.vstack([np.zeros((2, 2)), tyre])  # force on each coordinate per height
        total = mass * s**2 - gravity + springs.T @ spring @ springs + block_diag(np.zeros((2, 2)), tyre)
        gains.append(tyre - below.T @ np.linalg.solve(total, below))
    return np.array(gains)


@pytest.mark.slow
def test_the_load_on_a_rough_road_is_that_of_a_half_car() -> None:
    """Over time, on the mean of both tracks, and its RMS on the whole road by the spectrum."""
    properties, speed, roughness = NO_RESISTANCE, 25.0, ROAD_CLASSES["C"]
    front, rear = (axle.x for axle in sprung_bodies(tractor(), properties)[0].axles)
    n = np.fft.rfftfreq(COUNT, STEP)
    inside = (n >= BAND[0]) & (n <= BAND[1])
    knots = np.geomspace(*BAND, 1500)
    by_front, by_rear = (np.interp(n[inside], knots, gain) for gain in half_car(knots * speed, properties)[:, 0].T)
    gain = by_front + by_rear * np.exp(2j * np.pi * n[inside] * (rear - front))
    spectrum = np.fft.rfft(tracks(roughness, TRACK, seed=5)[0].mean(axis=0))
    spectrum[~inside] = 0
    spectrum[inside] *= gain
    whole = np.fft.irfft(spectrum, COUNT)

    plant = Plant(tractor(), replace(NO_RESISTANCE, roughness=roughness))
    load = plant.drive(straight(speed=speed, duration=8.0), seed=5).truth["vertical_force.tractor.front"]
    place = speed * (SETTLING_TIME + 0.01 * np.arange(len(load))) + front
    expected = np.interp(place, STEP * np.arange(COUNT), whole)
    later = slice(100, None)
    difference = load[later] - load[later].mean() - (expected[later] - expected[later].mean())
    assert np.std(difference) < 0.03 * np.std(expected[later])

    of_mean = [(1 + ratio_of_an_isotropic_surface(k, TRACK)) / 2 for k in knots[::30]]
    density = np.interp(n[inside], knots[::30], of_mean) * roughness * (n[inside] / 0.1) ** -2
    assert np.std(whole) == pytest.approx(np.sqrt(np.trapezoid(np.abs(gain) ** 2 * density, n[inside])), rel=0.01)


@pytest.mark.slow
def test_a_run_on_a_rough_road_is_reproducible_and_has_the_loads_of_a_smooth_one() -> None:
    course = straight(speed=25.0, duration=4.0)

    def loads(seed: int, roughness: float = B) -> np.ndarray:
        truth = Plant(TRUCK, Properties(roughness=roughness)).drive(course, seed=seed).truth
        return np.array([values for name, values in truth.items() if name.startswith("vertical_force")])

    first = loads(1)
    np.testing.assert_array_equal(first, loads(1))
    assert not np.allclose(first, loads(2))
    np.testing.assert_allclose(first.mean(axis=1), loads(1, 0.0).mean(axis=1), rtol=0.03)
    assert (first.std(axis=1) / first.mean(axis=1)).max() < 0.2


def test_how_a_roughness_is_stated() -> None:
    assert with_changes(Properties(), {"roughness": "C"}).roughness == 256e-6
    assert with_changes(Properties(), {"roughness": "64e-6 m^3"}).roughness == 64e-6
    assert with_changes(Properties(), {"roughness": "b"}) == with_changes(Properties(), {"roughness": "B"})
    for changes in ({"roughness": "B"}, {"bank": "2 deg"}, {"friction": "0.6"}):  # texts are for the command line
        with pytest.raises(VehicleError, match=f"{next(iter(changes))}: expected a number in SI"):
            Properties(**changes)
    with pytest.raises(VehicleError, match=r"roughness: .*, got 'Z'.* class of ISO 8608, A to H"):
        with_changes(Properties(), {"roughness": "Z"})
    with pytest.raises(VehicleError, match=r"roughness: expected 0 or more .* class B"):
        Properties(roughness=64.0)


def test_a_run_that_rolls_over_leaves_no_file(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    rough = Plant(get("cheng_cebon_2011"), Properties(roughness=0.26))
    with pytest.raises(SignalError, match="roughness of the road"):
        rough.drive(straight(speed=24.0, duration=5.0))
    assert not list(tmp_path.iterdir())
