"""
Monte Carlo: is sigma right?
============================

A study simulates and identifies twenty logs of one lane change. They differ in their sensor noise and first guess, and
nothing else is uncertain. If sigma is right, the errors divided by sigma have a standard deviation of one.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import fifthwheel as fw

table = fw.study(
    ["cheng_cebon_2011"],
    {"one stage": fw.OneStage(given={"others": "exact", "sensors": "exact"}, tyres="linear")},
    Path(tempfile.mkdtemp()) / "study.parquet",
    manoeuvres={"one lane change": fw.SimulatedRun(count=1)},
    seeds=range(20),
    jobs=1,  # by default one process per core
)

# %%
# The table has a row for each run and parameter.

column = {name: np.array(table[name].to_pylist()) for name in ("parameter", "truth", "estimate", "sigma")}
names = list(dict.fromkeys(column["parameter"]))
error = 100 * (column["estimate"] / column["truth"] - 1)
score = (column["estimate"] - column["truth"]) / column["sigma"]

figure, axes = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
axes[0].boxplot([error[column["parameter"] == name] for name in names], orientation="horizontal", tick_labels=names)
axes[0].invert_yaxis()
axes[0].set(title="error, %")
axes[1].hist(score, bins=np.arange(-4, 4.1, 0.5), density=True, alpha=0.6)
grid = np.linspace(-4, 4, 200)
axes[1].plot(grid, np.exp(-(grid**2) / 2) / np.sqrt(2 * np.pi), color="black", label="standard normal")
axes[1].set(title=f"error / sigma; {np.mean(np.abs(score) < 1.645):.0%} within the 90 % interval")
axes[1].legend()
plt.show()
