"""
From a CSV file to parameters
=============================

A log with two lane changes of a 40 t tractor-semitrailer identifies the cornering stiffness of every axle group, the
yaw inertia of the trailer and the height of its payload.
"""

from pathlib import Path

import matplotlib.pyplot as plt

import fifthwheel as fw

examples = Path.cwd().parent  # the folder `examples` of the checkout
record = fw.read_log(examples / "lane_changes.csv")
truck = fw.Vehicle.load(examples / "truck.toml")  # contains a first guess of the parameters
result = fw.identify([record], truck)

for estimate in result.parameters:
    print(f"{estimate.name:38} {estimate.value:12.4g} +- {estimate.sigma:8.2g} {estimate.unit:8} {estimate.verdict}")

# %%
# The log is a simulation of the nonlinear truck, so the true values are known. The bars are one sigma.

true = {
    "tractor.front.cornering_stiffness": 475e3,
    "tractor.drive.cornering_stiffness": 766e3,
    "semitrailer.cornering_stiffness": 1273e3,
    "semitrailer.yaw_inertia": 413.7e3,
    "semitrailer.payload.height": 1.23,
}
figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
for row, (name, value) in enumerate(true.items()):
    axes.errorbar(result[name].value / value, row, xerr=result[name].sigma / value, fmt="o", capsize=4, color="C0")
    axes.plot(truck.parameters()[name] / value, row, "x", color="C1")
axes.axvline(1, color="grey", linewidth=1)
axes.set(yticks=range(len(true)), yticklabels=true, xlabel="value / true value (circle: estimate, cross: first guess)")
axes.invert_yaxis()
plt.show()
