"""The memory of long logs: what each sample of a record needs beyond the record itself."""

import gc
import tracemalloc
from collections.abc import Callable

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import OneStage
from fifthwheel.estimate.identify.dataset import Dataset, prepare_dataset
from fifthwheel.estimate.identify.one_stage.problem import Problem
from fifthwheel.estimate.identify.setup import Setup
from fifthwheel.estimate.observe import Observer, ObserverSettings, Uncertainty
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get

TRUCK = get("cheng_cebon_2011")
# the difference in samples is large, because a thread more or less at the time of a peak is 300 kB
SHORT, LONG = (simulate(TRUCK, count=count, seed=1) for count in (5, 45))
UNCERTAIN = Uncertainty(names=("semitrailer.cog", "yaw_rate.tractor.gain"), covariance=np.diag([1e-4, 4e-6]))


def peak(work: Callable[[], object]) -> int:
    """Largest memory of an operation, bytes."""
    gc.collect()
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def bytes_per_sample(work: Callable[[Record], object]) -> float:
    """By how much the largest memory of an operation grows with each sample of a record."""
    work(SHORT)  # compiles, and fills caches
    short, long = (peak(lambda record=record: work(record)) for record in (SHORT, LONG))
    return (long - short) / (len(LONG) - len(SHORT))


@pytest.mark.slow
def test_states_need_little_more_than_themselves_and_smoothed_ones_than_both_passes() -> None:
    observer = Observer(TRUCK, SHORT.signals, ObserverSettings(bank=0.0, steer_offset=0.0))
    of_states = len(observer.reported) * 16  # values and sigmas
    of_outputs = len(observer.outputs) * 17 + 9  # innovations, status
    of_inputs = len(observer.model.inputs) * 8
    assert bytes_per_sample(lambda log: observer.batch(log, UNCERTAIN)) < of_states + of_outputs + of_inputs + 84
    assert bytes_per_sample(lambda record: observer.smooth(record, UNCERTAIN)) < 3 * of_states + 150


@pytest.mark.slow
def test_derivatives_are_summed_in_chunks() -> None:
    settings = OneStage(tyres="linear")

    def prepare(record: Record) -> Dataset:
        return prepare_dataset([record], TRUCK, settings, findings=False)

    datasets = {len(record): prepare(record) for record in (SHORT, LONG)}

    def expand(record: Record) -> None:
        dataset = datasets[len(record)]
        problem = Problem(Setup.of(dataset.vehicle, dataset.outputs, settings), dataset.logs)
        z = np.zeros(len(problem.names))
        assert len(z) > 20
        problem.expand(z)
        problem.with_residual_noise(z, autocorrelated=True)

    assert bytes_per_sample(prepare) < 320
    assert bytes_per_sample(expand) < 75
