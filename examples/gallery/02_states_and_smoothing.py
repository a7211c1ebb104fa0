"""
States and smoothing
====================

No sensor measures the sideslip of the trailer. The observer estimates it from gyros, steer angle and speed, either
filtered (from the samples so far) or smoothed (from all samples of the log).
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import fifthwheel as fw

examples = Path.cwd().parent
record = fw.read_log(examples / "lane_changes.csv")
result = fw.identify([record], fw.Vehicle.load(examples / "truck.toml"))

# %%
# The estimated offsets and noise of the sensors are settings of the observer. The uncertainty of the parameters is part
# of every sigma.

observer = fw.Observer(result.vehicle, record.signals, result.observer_settings(record.name))
uncertainty = result.uncertainty(record.name)
filtered = observer.batch(record, uncertainty)
smoothed = observer.smooth(record, uncertainty)

name = "sideslip.semitrailer"
true = record.reference[name]
figure, (above, below) = plt.subplots(2, 1, figsize=(7, 5), sharex=True, layout="constrained")
above.plot(record.time, np.degrees(true), color="black", label="true")
for axes, states, label in ((below, filtered, "filtered"), (below, smoothed, "smoothed")):
    error = np.degrees(states.values[name] - true)
    above.plot(record.time, np.degrees(states.values[name]), "--", label=label)
    (line,) = axes.plot(record.time, error, label=f"{label}, rms {np.sqrt(np.mean(error**2)):.3f}")
    sigma = np.degrees(states.sigma[name])
    axes.fill_between(record.time, -2 * sigma, 2 * sigma, color=line.get_color(), alpha=0.15, linewidth=0)
above.set(ylabel="sideslip of the trailer, deg", title="Sideslip of the trailer in two lane changes")
below.set(ylim=(-0.4, 0.4), ylabel="error, deg", xlabel="time, s", title="Error, and a band of two sigma")
for axes in (above, below):
    axes.legend(loc="upper right")
plt.show()

# %%
# Sample by sample, `push` gives the same filtered states to the last bit.

observer.reset()
for k in range(300):
    now = observer.push({"time": record.time[k]} | {n: values[k] for n, values in record.signals.items()})
print(now[name] == filtered.values[name][299])
