"""
Monte Carlo: is sigma right?
============================

Twenty logs of one lane change differ in their sensor noise, and nothing else is uncertain. If sigma is right, the
errors divided by sigma have a standard deviation of one.
"""

import matplotlib.pyplot as plt
import numpy as np

from fifthwheel import vehicle
from fifthwheel.identify import OneStage, identify
from fifthwheel.simulate import simulate

truck = vehicle.get("cheng_cebon_2011")
settings = OneStage(consider={}, nuisances=False)
names = [f"{group}.cornering_stiffness" for group in ("tractor.front", "tractor.drive", "semitrailer")]
names += ["semitrailer.yaw_inertia", "semitrailer.payload.height"]
true = np.array([truck.parameters()[name] for name in names])
rng = np.random.default_rng(1)
errors, scores = [], []
for seed in range(20):
    guess = truck.replace(dict(zip(names, true * rng.uniform(0.8, 1.2, len(names)), strict=True)))
    result = identify([simulate(truck, count=1, seed=seed)], guess, settings)
    values = np.array([result[name].value for name in names])
    sigmas = np.array([result[name].sigma for name in names])
    errors.append(100 * (values / true - 1))
    scores.append((values - true) / sigmas)

figure, axes = plt.subplots(1, 2, figsize=(9, 3.4), layout="constrained")
axes[0].boxplot(np.array(errors), tick_labels=["front", "drive", "trailer", "inertia", "height"])
axes[0].set(title="error, %")
inside = np.mean(np.abs(scores) < 1.645)
axes[1].hist(np.ravel(scores), bins=np.arange(-4, 4.1, 0.5), density=True, alpha=0.6)
grid = np.linspace(-4, 4, 200)
axes[1].plot(grid, np.exp(-(grid**2) / 2) / np.sqrt(2 * np.pi), color="black", label="standard normal")
axes[1].set(title=f"error / sigma; {inside:.0%} within the 90 % interval")
axes[1].legend()
plt.show()
