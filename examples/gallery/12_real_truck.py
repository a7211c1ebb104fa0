"""
A real truck
============

Two logs of a 6x4 tractor with a two-axle semitrailer, measured by GAVLab of Auburn University. They are not part of
fifthwheel. Put ``run01_s_bend.csv`` and ``run02_exit_ramp.csv`` into a folder ``real_truck``, and name its parent
folder in the environment variable ``FIFTHWHEEL_DATA``. Without them this page shows the same with simulated logs of
such a truck. The page *Accuracy and speed* has the results of the real ones.
"""

import os
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import fifthwheel as fw

truck = fw.vehicle("auburn_6x4")
signal_map = fw.SignalMap.parse("""
[time]
column = "t"

[signals]
speed = "vx"
"steer.tractor.front" = "steer_ang"
"yaw_rate.tractor" = "yaw_rate"
"articulation.semitrailer" = "hitch"
"yaw_rate.semitrailer" = { sum = ["yaw_rate", "hitch_rate"] }
""")

# %%
# The first log identifies the truck, the second one validates it.

folder = Path(os.environ.get("FIFTHWHEEL_DATA", "")) / "real_truck"
if folder.is_dir():
    first, second = (fw.read_log(folder / f"{name}.csv", signal_map) for name in ("run01_s_bend", "run02_exit_ramp"))
    source = "measured"
else:
    first = fw.simulate(truck, manoeuvre="lane_changes", count=2, seed=1)
    second = fw.simulate(truck, manoeuvre="bend", duration=15.0, seed=2, name="bend")
    source = "simulated"
result = fw.identify([first], truck, validate=[second])
for estimate in result.parameters:
    print(f"{estimate.name:36} {estimate.value:10.4g} +- {estimate.sigma:8.2g} {estimate.unit:8} {estimate.verdict}")

# %%
# Prediction of the second log, from its speed and steer angle alone.

fit = next(fit for fit in result.fits if fit.log == second.name and fit.signal == "yaw_rate.tractor")
figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
axes.plot(fit.time, np.degrees(fit.measured), label=source)
axes.plot(fit.time, np.degrees(fit.predicted), label="predicted with the truck of the first log")
axes.set(
    title=f"Second log, {source}: {fit.explained:.0%} explained",
    xlabel="time, s",
    ylabel="yaw rate of the tractor, deg/s",
)
axes.legend()
plt.show()
