"""Computation in child processes: results, errors, progress, and an end at once."""

import asyncio
import multiprocessing.connection
import os
import time

import pytest

from fifthwheel.apps.app import jobs
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.spelling import front_end, spelled_for


def square(x, progress=None):
    if progress is not None:
        progress("squaring", 1, 2)
    return x * x


def refuse(progress=None):
    raise FifthwheelError("speed: missing; map it")


def crash(progress=None):
    os._exit(9)


def words(progress=None):
    return front_end()


def wait(file, progress):
    progress("waiting", 0, 0)
    time.sleep(60)
    file.write_text("too late")


@pytest.fixture(autouse=True)
def _end():
    yield
    jobs.cancel_all()


def ended(job, state="running"):
    end = time.monotonic() + 30
    while job.state == state and time.monotonic() < end:
        time.sleep(0.02)
    return job


def test_progress_is_in_words_with_the_time_left_where_it_can_be_known(monkeypatch):
    now = 100.0
    monkeypatch.setattr(jobs.time, "monotonic", lambda: now)
    job = jobs.Job(started=now, title_since=now)
    assert job.words() == "starting, 0 s so far"
    job.report("states", 0, 4)
    now += 6
    assert job.words() == "states, 0 of 4, 6 s so far"
    job.report("states", 3, 4)
    assert job.words() == "states, 3 of 4, 6 s so far, 2 s left"
    job.report("reading a.csv", 0, 1000)
    now += 2
    job.report("reading a.csv", 250, 1000)
    assert job.words() == "reading a.csv, 25 %, 8 s so far, 6 s left"
    job.report("fit with estimated noise", 2, 30)
    assert job.words() == "fit with estimated noise, step 3 of at most 30, 8 s so far"


def test_a_job_gives_its_result_its_progress_and_its_error():
    job = ended(jobs.start("a", square, 7))
    assert (job.state, job.result, job.title, job.fraction) == ("done", 49, "squaring", 0.5)
    assert jobs.get("a") is job
    refused, crashed = ended(jobs.start("refuse", refuse)), ended(jobs.start("crash", crash))
    assert (refused.state, refused.error) == ("failed", "speed: missing; map it")
    assert (crashed.state, crashed.error[:5]) == ("failed", "ended")
    with spelled_for("workbench"):
        assert ended(jobs.start("words", words)).result == "workbench"


def test_a_cancelled_job_ends_at_once(tmp_path):
    job = jobs.start("wait", wait, tmp_path / "file")
    assert jobs.start("wait", wait, tmp_path / "file") is job
    while job.title != "waiting":
        time.sleep(0.02)
    job.cancel()
    assert multiprocessing.connection.wait([job.process.sentinel], timeout=5)  # the thread of the job joins it too
    assert job.state == "cancelled"
    assert not (tmp_path / "file").exists()
    assert ended(jobs.start("wait", square, 2)).result == 4


def test_short_computations_share_a_process_and_survive_its_crash():
    async def all_of_it():
        assert await asyncio.gather(*(jobs.compute(square, x) for x in range(4))) == [0, 1, 4, 9]
        with pytest.raises(FifthwheelError, match="speed: missing"):
            await jobs.compute(refuse)
        with pytest.raises(FifthwheelError, match="ended by the system"):
            await jobs.compute(crash)
        assert await jobs.compute(square, 5) == 25

    asyncio.run(all_of_it())


def test_only_its_own_processes_end_with_the_server():
    other = multiprocessing.get_context("spawn").Process(target=time.sleep, args=(60,), daemon=True)
    other.start()
    assert asyncio.run(jobs.compute(square, 3)) == 9
    (own,) = [process for process in multiprocessing.active_children() if process.pid != other.pid]
    jobs.cancel_all()
    assert multiprocessing.connection.wait([own.sentinel], timeout=10)  # the thread of the pool joins it too
    assert other.is_alive()
    other.kill()
    other.join()
