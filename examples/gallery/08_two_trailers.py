"""
On-line learning of two trailers
================================

The recursive learner takes one sample at a time. The driver changes the trailer; the learner keeps what it knows of the
tractor, and of each trailer.
"""

import matplotlib.pyplot as plt
import numpy as np

import fifthwheel as fw

catalogue = fw.vehicle("cheng_cebon_2011")
names = ("tractor.drive.cornering_stiffness", "semitrailer.cornering_stiffness")
new_tyres = catalogue
worn_tyres = catalogue.replace({"semitrailer.cornering_stiffness": 1.35 * catalogue.parameters()[names[1]]})
guess = catalogue.replace(
    {name: factor * catalogue.parameters()[name] for name, factor in zip(names, (1.2, 0.8), strict=True)}
)
runs = [("A", new_tyres), ("B", worn_tyres), ("A", new_tyres)]

settings = fw.OneStage(given={"others": "exact"})
learner = fw.Learner(guess, fw.simulate(catalogue, count=1).signals, settings, trailer="A")
history = []
for number, (trailer, truck) in enumerate(runs):
    if number:
        learner.couple(trailer, guess)
    record = fw.simulate(truck, count=3, seed=number)
    begin = number * 40.0
    for k in range(len(record)):
        sample = {name: values[k] for name, values in record.signals.items()}
        learner.push({"time": begin + record.time[k]} | sample)
        if k % 25 == 0:
            estimates = [learner[name] for name in names]
            history.append([begin + record.time[k], *[x for e in estimates for x in (e.value, e.sigma)]])
    history.append([np.nan] * len(history[0]))  # a gap in the lines

# %%
# When trailer A comes back, the learner continues with its last estimate.

time, *columns = np.array(history).T
figure, axes = plt.subplots(2, 1, figsize=(8, 5), sharex=True, layout="constrained")
for axis, name, value, sigma in zip(axes, names, columns[::2], columns[1::2], strict=True):
    axis.plot(time, value / 1e3, ".", markersize=3)
    axis.fill_between(time, (value - sigma) / 1e3, (value + sigma) / 1e3, alpha=0.2, linewidth=0)
    for number, (_, truck) in enumerate(runs):
        axis.hlines(truck.parameters()[name] / 1e3, 40 * number, 40 * number + 24, color="black", linewidth=1)
    axis.set(ylabel="kN/rad", title=f"{name} with one sigma (black: true)")
for number, (trailer, _) in enumerate(runs):
    axes[1].text(40 * number + 12, 0.03, f"trailer {trailer}", ha="center", transform=axes[1].get_xaxis_transform())
axes[1].set(xlabel="time, s")
plt.show()
