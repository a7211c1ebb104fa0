"""
A real truck
============

Two logs of a 6x4 tractor with a two-axle semitrailer, measured by GAVLab of Auburn University. They are not part of
fifthwheel. Put ``run01_s_bend.csv`` and ``run02_exit_ramp.csv`` into a folder ``real_truck``, and name its parent
folder in the environment variable ``FIFTHWHEEL_DATA``. Without them this page shows only the signal map.
"""

import os
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import fifthwheel as fw

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
# The bend identifies the truck, the exit ramp validates it.

folder = Path(os.environ.get("FIFTHWHEEL_DATA", "")) / "real_truck"
figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
if folder.is_dir():
    bend, ramp = (fw.read_log(folder / f"{name}.csv", signal_map) for name in ("run01_s_bend", "run02_exit_ramp"))
    result = fw.identify([bend], fw.vehicle("auburn_6x4"), validate=[ramp])
    for estimate in result.parameters:
        print(
            f"{estimate.name:36} {estimate.value:10.4g} +- {estimate.sigma:8.2g} {estimate.unit:8} {estimate.verdict}"
        )
    fit = next(fit for fit in result.fits if fit.log == ramp.name and fit.signal == "yaw_rate.tractor")
    axes.plot(fit.time, np.degrees(fit.measured), label="measured")
    axes.plot(fit.time, np.degrees(fit.predicted), label="predicted with the truck of the bend")
    axes.set(
        title=f"Exit ramp: {fit.explained:.0%} explained", xlabel="time, s", ylabel="yaw rate of the tractor, deg/s"
    )
    axes.legend()
else:
    print("no logs: set FIFTHWHEEL_DATA to the folder that contains real_truck/")
    axes.text(0.5, 0.5, "no logs: FIFTHWHEEL_DATA is not set", ha="center")
    axes.set_axis_off()
plt.show()
