"""
Design an experiment
====================

The shortest test run that reaches a required accuracy, within limits of speed and lateral acceleration.
"""

import matplotlib.pyplot as plt
import numpy as np

import fifthwheel as fw
from fifthwheel.estimate.design import DesignSettings

truck = fw.vehicle("cheng_cebon_2011")
design = fw.design_experiment(
    truck,
    {"semitrailer.yaw_inertia": 0.07, "semitrailer.cornering_stiffness": 0.07},
    planning=DesignSettings(speeds=(80 / 3.6,), frequencies=(0.3, 0.4), accelerations=(1.0,)),
)
print("targets reached" if design.met else f"not reached: {[target.name for target in design.unmet]}")
for run in (design.best, *design.alternatives):
    sigmas = ", ".join(f"{name} {100 * run.sigma[name]:.1f} %" for name in design.targets)
    print(f"{run.repetitions} x {run.kind}, {3.6 * run.speed:.0f} km/h, {run.duration:.0f} s: {sigmas}")

# %%
# The best run as a steer angle over time. ``fifthwheel design --out steer.csv`` writes it to a file.

figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
for run, style in zip((design.best, *design.alternatives), ("-", "--", ":", "-."), strict=False):
    time = np.arange(len(run.steer)) / design.rate
    axes.plot(time, np.degrees(run.steer), style, label=f"{run.repetitions} x {run.kind}, {3.6 * run.speed:.0f} km/h")
axes.set(xlabel="time, s", ylabel="steer angle, deg", title="Runs that reach the targets, the best first")
axes.legend(loc="lower right")
plt.show()
