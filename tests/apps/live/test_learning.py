"""Learning while driving: trailers, locks, checkpoints, and changes that nobody reports."""

import json

import pytest

from fifthwheel.apps.live.checkpoint import Checkpoint, make_learning
from fifthwheel.apps.live.learning import STANDSTILL, Learning
from fifthwheel.apps.live.outputs.recorder import BackgroundWriter
from fifthwheel.apps.live.session import Session
from fifthwheel.apps.live.setup import completed_map, make_node
from fifthwheel.apps.live.status import LiveFault
from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.data.logs.can.database import Frame
from fifthwheel.data.record import SensorPrior
from fifthwheel.estimate.identify import OneStage, identify
from fifthwheel.estimate.identify.knowledge.information import Occasion
from fifthwheel.model.simulate import simulate
from tests.apps.live.truck_bus import SIGNALS, TRUCK, frames, write_files

STIFF = "semitrailer.cornering_stiffness"


def samples(vehicle, count, start=0.0, seed=1):
    record = simulate(vehicle, count=count, seed=seed)
    for k, time in enumerate(record.time.tolist()):
        yield {"time": start + time, **{name: float(record.signals[name][k]) for name in SIGNALS}}


def standstill(start, seconds):
    for k in range(int(seconds * 10)):
        yield {"time": start + 0.1 * k, **dict.fromkeys(SIGNALS, 0.0)}


def push(learning, stream):
    answer = {}
    for sample in stream:
        answer = learning.push(sample)
    return answer["time"] + 0.01


@pytest.fixture(scope="module")
def learned():
    """A learner after 24 s with excitation."""
    learning = make_learning(TRUCK, SIGNALS, trailer="depot 1")
    return learning, push(learning, samples(TRUCK, 3))


@pytest.fixture(scope="module")
def state(learned, tmp_path_factory):
    path = tmp_path_factory.mktemp("state") / "truck.json"
    learned[0].learner.save(path)
    return path


@pytest.mark.slow
def test_a_changed_load_is_found_after_a_standstill_and_not_averaged_in(state):
    learning = make_learning(TRUCK, SIGNALS, path=state)
    before = learning.learner[STIFF]
    soft = TRUCK.replace({STIFF: 0.4 * TRUCK.parameters()[STIFF]})
    start = push(learning, standstill(0.0, STANDSTILL + 5))
    push(learning, samples(soft, 5, start, seed=2))
    assert learning.learner.trailer == "depot 1 (load 2)"
    assert learning.faults & LiveFault.CHANGED
    assert "the cornering stiffness of the trailer tyres by " in learning.change
    after = learning.learner[STIFF]
    assert abs(after.value - soft.parameters()[STIFF]) < 3 * after.sigma
    learning.couple("depot 1")  # its estimates are those of before the standstill
    assert learning.learner[STIFF].value == pytest.approx(before.value, rel=1e-9)


def test_a_restart_continues_with_the_estimates_and_the_same_load_after_a_standstill(state, learned):
    learning = make_learning(TRUCK, SIGNALS, path=state)
    before, saved = learning.learner[STIFF], learned[0].learner[STIFF]
    assert (before.value, before.verdict) == (saved.value, saved.verdict)
    assert before.sigma == pytest.approx(saved.sigma, rel=1e-12)
    start = push(learning, standstill(0.0, STANDSTILL + 5))
    push(learning, samples(TRUCK, 4, start, seed=3))
    assert learning.learner.trailer == "depot 1"
    assert learning.change == ""
    assert learning.learner[STIFF].sigma < before.sigma
    assert learning._second is None


def test_each_trailer_has_its_own_estimates(state):
    learning = make_learning(TRUCK, SIGNALS, path=state, trailer="depot 2")
    fresh = make_learning(TRUCK, SIGNALS)
    assert learning.learner[STIFF].sigma == pytest.approx(fresh.learner[STIFF].sigma)
    front, before = (of.learner["tractor.front.cornering_stiffness"].sigma for of in (learning, fresh))
    assert front < 0.5 * before
    learning.couple("depot 1")
    assert learning.learner[STIFF].sigma < fresh.learner[STIFF].sigma


@pytest.mark.slow
def test_a_locked_parameter_keeps_its_estimate(state, learned, tmp_path):
    value = learned[0].learner[STIFF].value
    learning = make_learning(TRUCK, SIGNALS, path=state, locks=[STIFF])
    assert STIFF not in [estimate.name for estimate in learning.parameters]
    assert learning.learner.vehicle().parameters()[STIFF] == pytest.approx(value)
    path = tmp_path / "locked.json"
    learning.learner.save(path)
    again = make_learning(TRUCK, SIGNALS, path=path, locks=[STIFF])
    assert again.learner.vehicle().parameters()[STIFF] == pytest.approx(value)
    free = make_learning(TRUCK, SIGNALS, path=path)
    assert free.learner[STIFF].verdict == "not_excited"
    assert free.learner["semitrailer.yaw_inertia"] == learning.learner["semitrailer.yaw_inertia"]


def test_a_state_of_another_truck_is_refused(state):
    with pytest.raises(SignalError, match="another vehicle file"):
        make_learning(TRUCK.replace({"tractor.mass": 9000.0}), SIGNALS, path=state)
    with pytest.raises(SignalError, match="which is not mapped"):
        make_learning(TRUCK, [name for name in SIGNALS if name != "roll_rate.tractor"], path=state)
    with pytest.raises(VehicleError, match="no such parameter"):
        make_learning(TRUCK, SIGNALS, locks=["semitrailer.colour"])
    sensors = {"yaw_rate.tractor": SensorPrior(sensor_class="mems", errors={"gain": (1.0, 0.002)})}
    with pytest.raises(SignalError, match=r"other sensor classes or uncertainties in signals.toml; give another"):
        make_learning(TRUCK, SIGNALS, path=state, sensors=sensors)


def test_checkpoints_are_written_while_it_learns_and_a_full_disk_keeps_the_former_one(learned, tmp_path, monkeypatch):
    learning, now, writer = Learning(learned[0].learner, TRUCK), [0.0], BackgroundWriter()
    path = tmp_path / "truck.json"
    path.write_text("former")
    checkpoint = Checkpoint(learning, path, writer, now=lambda: now[0])

    def full(*_):
        raise OSError(28, "No space left on device")

    now[0] = 60.0
    checkpoint.update()
    assert writer._jobs.empty()  # nothing was learned
    monkeypatch.setattr("os.fsync", full)
    learning.learned += 1
    now[0] = 66.0
    checkpoint.update()
    writer.close()
    assert "No space left" in writer.errors["checkpoint"]
    assert path.read_text() == "former"
    monkeypatch.undo()
    writer = checkpoint._writer = BackgroundWriter()
    writer.errors["checkpoint"] = "full"
    now[0] = 72.0
    checkpoint.update()  # tried again, although nothing was learned
    writer.close()
    assert json.loads(path.read_text())["content"]["trailer"] == "depot 1"
    assert not writer.errors


def test_a_number_on_the_bus_names_the_trailer(tmp_path):
    complete = completed_map(write_files(tmp_path))
    learning = make_learning(TRUCK, SIGNALS, trailer="unknown")
    node = make_node(complete, learning, extra=("TrailerName.number",))
    session = Session(node=node, writer=BackgroundWriter(), learning=learning, trailer_column="TrailerName.number")
    for k, frame in enumerate(frames(simulate(TRUCK, count=1))):
        name = Frame(frame.time, 259, (4711 if k < 300 else 12).to_bytes(4, "little"))
        for output in (*node.receive(name), *node.receive(frame)):
            session.handle(output)
            assert output.faults & ~LiveFault.CHANGED == 0  # the name is no signal whose absence is a fault
        if k == 290:
            assert learning.learner.trailer == "4711"
        if k > 600:
            break
    session.close()
    assert learning.learner.trailer == "12"


@pytest.mark.slow
def test_a_new_state_begins_with_knowledge_and_one_that_exists_continues(tmp_path):
    """With the trailer of the last log, unless another one is named; a trailer of the result has its own estimates."""
    log, occasion = simulate(TRUCK, count=1, seed=5), Occasion(trailer="depot 7", load="steel")
    kept = identify([log], TRUCK, OneStage(tyres="linear"), occasion=occasion).knowledge
    learning = make_learning(TRUCK, SIGNALS, knowledge=kept)
    assert learning.learner.trailer == "depot 7"
    sigma = learning.learner[STIFF].sigma
    assert sigma < 0.5 * make_learning(TRUCK, SIGNALS).learner[STIFF].sigma
    learning.learner.save(tmp_path / "truck.json")
    other = make_learning(TRUCK, SIGNALS, path=tmp_path / "truck.json", trailer="depot 8", knowledge=kept)
    assert other.learner[STIFF].sigma > 2 * sigma
    other.couple("depot 7")
    assert other.learner[STIFF].sigma == pytest.approx(sigma, rel=1e-6)
