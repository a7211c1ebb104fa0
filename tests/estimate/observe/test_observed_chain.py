"""The model of an observer."""

import pytest

from fifthwheel.estimate.observe.observer_step import _observed_chain
from fifthwheel.model import dynamics
from tests.estimate.observe.conftest import YAWS


@pytest.mark.parametrize("estimate_bank", [False, True])
def test_sizes_are_known_without_the_functions(truck, estimate_bank):
    """An observer whose machine code is in the cache builds no symbolic function."""
    offsets = tuple(f"{name}.offset" for name in truck.steer_signals())
    chain = dynamics.model(truck, YAWS, roll=True, bank=True, free=offsets)
    offsets = (*offsets, "lateral_acceleration.tractor.offset")  # no output of this chain depends on it
    model = _observed_chain.__wrapped__(chain, offsets, estimate_bank)
    n, n_d, n_p, n_c, m = model.sizes
    assert "_symbols" not in vars(model)
    assert [model.transition.numel_in(i) for i in range(5)] == [n, 1, n_d, n_p, n_c]
    assert (model.transition.numel_out(0), model.observation.numel_out(0)) == (n, m)
    n_considered = not estimate_bank
    assert model.transition_parts.size_out(0) == (n + n_considered, n + n_considered)
    assert model.observation_jacobian.size_out(0) == (m, n + n_considered)
