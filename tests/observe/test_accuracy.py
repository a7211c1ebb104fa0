"""What the observer knows, against the truth, and how well it knows what it knows."""

import numpy as np
import pytest
from scipy.signal import cont2discrete
from scipy.stats import chi2

from fifthwheel import dynamics
from fifthwheel.errors import SignalError
from fifthwheel.logs import Record
from fifthwheel.logs.noise import GYROS
from fifthwheel.observe import Observer, ObserverSettings, Status
from fifthwheel.observe.noise import OBSERVED, SWING, initial
from fifthwheel.simulate import simulate
from fifthwheel.vehicle import Axle, AxleGroup, Coupling, Payload, SprungMass, Unit, Vehicle

from .conftest import ROLLS, STEER, YAWS, batched, pushed

DEGREE = np.pi / 180
SEEDS = 50


def group(name: str, stiffness: float, *axles: Axle) -> AxleGroup:
    return AxleGroup(
        name=name,
        axles=axles,
        cornering_stiffness=stiffness,
        roll_stiffness=1.2 * stiffness,
        tyre_roll_stiffness=3.5 * stiffness,
        roll_damping=0.05 * stiffness,
    )


def trailer(name: str, *axles: Axle) -> Unit:
    return Unit(
        name=name,
        mass=22000,
        cog=-4.6,
        yaw_inertia=170000,
        roll_axis_height=0.75,
        sprung=SprungMass(mass=6000, cog_height=1.3, roll_inertia=7800, roll_yaw_product=0),
        payload=Payload(mass=14000, height=1.3, width=2.3, floor_height=1.2),
        axle_groups=(group("axles", 9e5, *axles),),
    )


@pytest.fixture(scope="module")
def b_double() -> Vehicle:
    """Three units, the last with a steered axle that nobody logs."""
    tractor = Unit(
        name="tractor",
        mass=8800,
        cog=-1.9,
        yaw_inertia=41000,
        roll_axis_height=0.55,
        sprung=SprungMass(mass=6500, cog_height=1.1, roll_inertia=5000, roll_yaw_product=1500),
        axle_groups=(
            group("front", 4e5, Axle(name="front", position=0, steerable=True)),
            group("drive", 9e5, Axle(name="second", position=-4.2), Axle(name="third", position=-5.5)),
        ),
    )
    lead = trailer("lead", Axle(name="one", position=-7.0), Axle(name="two", position=-8.3))
    last = trailer("last", Axle(name="one", position=-7.2), Axle(name="two", position=-8.5, steerable=True))
    wheels = [
        Coupling(
            name=name,
            leading_position=leading,
            trailing_position=0,
            height=1.2,
            roll_stiffness=2e6,
            roll_damping=1e4,
        )
        for name, leading in (("front_wheel", -4.7), ("rear_wheel", -7.6))
    ]
    return Vehicle(name="b_double", units=(tractor, lead, last), couplings=tuple(wheels))


def rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(error**2)))


def test_sideslip_roll_and_articulation_of_the_linear_truck(truck, drive):
    found = Observer(truck, drive.signals).batch(drive)
    assert {"sideslip.semitrailer", "roll.semitrailer", "articulation.semitrailer"} <= drive.reference.keys()
    for name, truth in drive.reference.items():
        assert np.ptp(truth) > 0.2 * DEGREE, name
        assert rms(found.values[name] - truth) < 0.05 * DEGREE, name


def test_a_start_within_a_lane_change_is_soon_forgotten(truck, drive):
    """Wherever a record begins, sigma says how far off it may be, and hardly a sample is taken for an outlier."""
    for start in np.arange(1.0, 4.5, 0.05):
        record = drive.cut(start)
        found = Observer(truck, record.signals).batch(record)
        for name, truth in record.reference.items():
            error = found.values[name] - truth
            assert np.abs(error / found.sigma[name]).max() < 4.5, (name, start)
            assert rms(error[100:]) < 0.05 * DEGREE, (name, start)
        for name, accepted in found.accepted.items():
            assert accepted[:100].mean() > 0.95, (name, start)


def noisy_truth(o: Observer, time: np.ndarray, steer: np.ndarray, speed: float) -> tuple[np.ndarray, ...]:
    """States (SEEDS, N, n) and measurements (SEEDS, N, m) of the very system that the filter assumes.

    Its motion is that of the continuous equations, discretised with a first-order hold; noise of the measured
    variances, and process noise of Q per second times the step, are added; it starts anywhere within P0.
    """
    random = np.random.default_rng(42)
    m = dynamics.matrices(o.vehicle, speed, roll=o.roll)
    step = time[1] - time[0]
    eye, none = np.eye(len(m.A)), np.zeros_like(m.B)
    F, G, _, H, _ = cont2discrete((m.A, m.B, eye, none), step, method="foh")
    inputs = {"speed": speed} | dict.fromkeys(o.inputs[1:], steer[0])
    x0, P0 = initial(o.vehicle, inputs, {}, roll=o.roll, swing=SWING)
    Q = np.diag([OBSERVED[name.split(".")[0]] for name in m.states]) * o.settings.process_noise
    shown = o.model.states
    assert shown == m.states
    # scipy's hold keeps an inner state: x = inner + H d
    x = x0 + random.normal(size=(SEEDS, len(x0))) @ np.linalg.cholesky(P0).T
    inner = x - H @ steer[:1]
    states = np.empty((SEEDS, len(time), len(x0)))
    states[:, 0] = x
    for k in range(1, len(time)):
        inner = inner @ F.T + G @ steer[k - 1 : k] + random.normal(size=x.shape) * np.sqrt(np.diag(Q) * step)
        states[:, k] = inner + H @ steer[k : k + 1]
    places = [m.states.index(name) for name in o.outputs]
    R = np.array([GYROS[name.split(".")[0]][0 if name.endswith(".tractor") else 1] for name in o.outputs])
    measured = states[:, :, places] + random.normal(size=(SEEDS, len(time), len(places))) * np.sqrt(R)
    return states, measured


def within(ratio: float, degrees: int, chance: float = 1e-5) -> bool:
    """Whether a mean of squares of so many independent standard normals may be that large, or that small."""
    low, high = chi2.ppf([chance / 2, 1 - chance / 2], degrees) / degrees
    return bool(low < ratio < high)


@pytest.mark.parametrize("process_noise", [1.0, 1e-6])
def test_sigma_is_honest(truck, process_noise):
    """Errors over sigma are standard normal: at any instant over 50 seeds, and innovations over all samples."""
    settings = ObserverSettings(process_noise=process_noise, gate=1e6)
    o = Observer(truck, {"speed", STEER, *YAWS, *ROLLS}, settings)
    speed, time = 88 / 3.6, np.arange(600) / 100
    steer = 0.02 * np.sin(2 * np.pi * 0.4 * time) * (time < 5)
    states, measured = noisy_truth(o, time, steer, speed)
    names = o.model.states
    error: dict[str, list[np.ndarray]] = {}
    innovations = []
    for x, y in zip(states, measured, strict=True):
        signals = {"speed": np.full(len(time), speed), STEER: steer}
        signals |= {name: y[:, i] for i, name in enumerate(o.outputs)}
        found = o.batch(Record(time=time, signals=signals))
        assert (found.status == Status.OK).all()
        truth = {name: x[:, i] for i, name in enumerate(names)}
        truth["sideslip.tractor"] = truth.pop("lateral_velocity.tractor") / speed
        for name, values in truth.items():
            if name.startswith("slip_angle."):
                continue  # not reported
            error.setdefault(name, []).append((found.values[name] - values) / found.sigma[name])
        innovations.append([found.innovation[n] / found.innovation_sigma[n] for n in o.outputs])
    assert len(error) == len(names) - 3 == 8
    for name, runs in error.items():
        for k in (0, 50, 200, 599):  # one instant: 50 independent runs
            assert within(float(np.mean(np.array(runs)[:, k] ** 2)), SEEDS), (name, k)
            assert abs(np.mean(np.array(runs)[:, k])) * np.sqrt(SEEDS) < 4.5, (name, k)
    squares = np.array(innovations) ** 2  # of the right filter they are independent in time and over channels
    assert within(float(squares.mean()), squares.size)
    for i, name in enumerate(o.outputs):
        assert within(float(squares[:, i].mean()), squares[:, i].size), name
    lagged = np.mean(np.array(innovations)[..., 1:] * np.array(innovations)[..., :-1])
    assert abs(lagged) * np.sqrt(squares.size) < 4.5


def test_sigma_does_not_pretend_on_a_quieter_truck(truck):
    """Without process noise in the truck, errors are smaller than the sigma that allows for it."""
    squares = []
    for seed in range(8):
        record = simulate(truck, count=1, seed=seed)
        found = Observer(truck, record.signals).batch(record)
        squares += [((found.values[n] - x) / found.sigma[n]) ** 2 for n, x in record.reference.items()]
    assert np.mean(squares) < 1.0
    assert np.max(squares) < 9.0


def test_three_units(b_double):
    record = simulate(b_double, count=2, seed=1)
    assert "steer.last.two" not in record.signals
    o = Observer(b_double, record.signals)
    assert o.inputs == ("speed", "steer.tractor.front")
    assert o.reported == tuple(
        f"{quantity}.{unit}"
        for quantity in ("sideslip", "yaw_rate", "articulation", "roll", "roll_rate")
        for unit in ("tractor", "lead", "last")
        if (quantity, unit) != ("articulation", "tractor")
    )
    found = o.batch(record)
    assert (found.status == Status.OK).all()
    assert len(record.reference) == 8
    for name, truth in record.reference.items():
        assert rms(found.values[name] - truth) < 0.1 * DEGREE, name
        assert np.abs((found.values[name] - truth) / found.sigma[name]).max() < 4, name
    streamed, whole = pushed(o, record), batched(o, record)
    for name in whole:
        np.testing.assert_array_equal(streamed[name], whole[name])


def test_with_a_steered_trailer_axle_that_is_logged(b_double):
    record = simulate(b_double, count=1)
    still = record.with_signals({"steer.last.two": np.zeros(len(record))})
    turned = record.with_signals({"steer.last.two": np.full(len(record), 0.02)})
    known, there, steered = (Observer(b_double, r.signals).batch(r) for r in (record, still, turned))
    for name in known.values:
        np.testing.assert_allclose(there.values[name], known.values[name], rtol=0, atol=1e-12)
    assert np.abs(steered.values["articulation.last"] - known.values["articulation.last"])[0] > 0.01


def test_without_roll_signals_the_yaw_model_observes(truck):
    record = simulate(truck, count=2, roll=False, seed=2)
    assert not any("roll" in name for name in (*record.signals, *record.reference))
    o = Observer(truck, record.signals)
    assert not o.roll
    assert o.reported == (
        "sideslip.tractor",
        "sideslip.semitrailer",
        "yaw_rate.tractor",
        "yaw_rate.semitrailer",
        "articulation.semitrailer",
    )
    found = o.batch(record)
    for name, truth in record.reference.items():
        assert rms(found.values[name] - truth) < 0.05 * DEGREE, name
    assert o.batch(record).innovation.keys() == set(YAWS)


@pytest.mark.parametrize("roll", [True, False])
def test_an_articulation_sensor_is_used(truck, roll):
    sensors = {YAWS[0]: 1.5e-5, "articulation.semitrailer": 0.005**2} | ({ROLLS[1]: 5e-5} if roll else {})
    record = simulate(truck, count=2, roll=roll, sensors=sensors)
    with_it = Observer(truck, record.signals)
    without = Observer(truck, set(record.signals) - {"articulation.semitrailer"})
    assert "articulation.semitrailer" in with_it.outputs
    one, other = with_it.batch(record), without.batch(record)
    assert one.sigma["articulation.semitrailer"][-1] < 0.9 * other.sigma["articulation.semitrailer"][-1]
    for found, most in ((one, 0.1), (other, 0.12)):  # the latter on one gyro alone; 0.07 on average over seeds
        for name, truth in record.reference.items():
            assert rms(found.values[name] - truth) < most * DEGREE, name


def test_roll_angle_sensors_are_used(truck):
    record = simulate(truck, count=1, sensors={YAWS[0]: 1.5e-5, "roll.tractor": 1e-6, "roll.semitrailer": 1e-6})
    o = Observer(truck, record.signals)
    assert o.roll
    assert o.outputs == (YAWS[0], "roll.tractor", "roll.semitrailer")
    assert (o.batch(record).sigma["roll.tractor"] < 0.005).all()


def test_signals_that_it_has_no_use_for_do_not_matter(truck, drive):
    more = drive.with_signals({"lateral_acceleration.tractor": np.full(len(drive), np.nan), "yaw.tractor": drive.time})
    one, other = (Observer(truck, record.signals).batch(record) for record in (drive, more))
    for name in one.values:
        np.testing.assert_array_equal(one.values[name], other.values[name])


def test_zeros_of_the_sensors_are_taken_out(truck, drive):
    zeros = {f"{STEER}.offset": 0.01, f"{STEER}.gain": 1.1} | {
        f"{name}.offset": zero for name, zero in zip((*YAWS, *ROLLS), (0.02, -0.015, 0.03, -0.01), strict=True)
    }
    off = {name: drive.signals[name] + zeros[f"{name}.offset"] for name in (*YAWS, *ROLLS)}
    off[STEER] = drive.signals[STEER] / 1.1 + 0.01
    record = drive.with_signals(off)
    good = Observer(truck, drive.signals).batch(drive)
    corrected = Observer(truck, record.signals, ObserverSettings(zeros=zeros)).batch(record)
    wrong = Observer(truck, record.signals).batch(record)
    for name in good.values:
        # the start is told from the steer angle as logged, and is soon forgotten
        np.testing.assert_allclose(corrected.values[name][400:], good.values[name][400:], rtol=0, atol=1e-5)
        assert np.abs(wrong.values[name] - good.values[name])[400:].mean() > 1e-3, name
    streamed = pushed(Observer(truck, record.signals, ObserverSettings(zeros=zeros)), record)
    np.testing.assert_array_equal(streamed["sideslip.semitrailer"], corrected.values["sideslip.semitrailer"])


def test_at_the_start_a_steer_zero_is_taken_out_too(truck, drive):
    record = drive.with_signals({STEER: drive.signals[STEER] + 0.03}).cut(0, 0.5)  # straight
    found = Observer(truck, record.signals, ObserverSettings(zeros={f"{STEER}.offset": 0.03})).batch(record)
    for name, truth in record.reference.items():
        assert abs(found.values[name] - truth)[0] < 0.2 * DEGREE, name


def test_a_steer_delay_is_taken_out(truck, drive):
    late = 0.05
    steer = np.interp(drive.time - late, drive.time, drive.signals[STEER])
    record = drive.with_signals({STEER: steer})
    settings = ObserverSettings(zeros={f"{STEER}.delay": late})
    name = "sideslip.semitrailer"
    with_it, without = (
        rms(Observer(truck, record.signals, s).batch(record).values[name] - drive.reference[name])
        for s in (settings, None)
    )
    assert with_it < 0.05 * DEGREE
    assert with_it < without


def test_less_noise_means_less_sigma(truck, drive):
    quiet = ObserverSettings(noise={YAWS[0]: 1e-8, YAWS[1]: 1e-8})
    one, other = (Observer(truck, drive.signals, s).batch(drive) for s in (quiet, None))
    assert one.sigma[YAWS[0]][-1] < 1.1e-4 < other.sigma[YAWS[0]][-1]
    assert one.sigma["sideslip.semitrailer"][-1] < other.sigma["sideslip.semitrailer"][-1]


def signals(*names: str) -> set[str]:
    return set(names)


@pytest.mark.parametrize(
    ("available", "starts"),
    [
        (signals("speed", *YAWS), r"^steer\.tractor\.front: not in the signals"),
        (signals(STEER, *YAWS), r"^speed: not among the signals"),
        (signals("speed", STEER), r"^yaw_rate\.tractor: not among the signals"),
        (signals("speed", STEER, "lateral_acceleration.tractor"), r"^yaw_rate\.tractor: "),
        (signals("speed", STEER, "yaw_rate.lorry"), r"^yaw_rate\.tractor: "),
        (signals("speed", STEER, "articulation.tractor"), r"^yaw_rate\.tractor: "),
        (signals("speed", "steer.tractor.drive", *YAWS), r"^steer\.tractor\.front: "),
        (signals(), r"^steer\.tractor\.front: "),
    ],
    ids=["no steer", "no speed", "nothing", "acceleration only", "another unit", "own articulation", "rear", "none"],
)
def test_what_an_observer_cannot_do_without(truck, available, starts):
    with pytest.raises(SignalError, match=starts):
        Observer(truck, available)


def test_a_record_without_the_signals_of_the_observer(truck, drive):
    o = Observer(truck, {*drive.signals, "articulation.semitrailer"})
    with pytest.raises(SignalError, match=r"^articulation\.semitrailer: not in simulated"):
        o.batch(drive)
