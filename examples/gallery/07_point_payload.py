"""
A payload that is not a uniform block
=====================================

By default the payload is a uniform block, so its height gives both CoG height and roll inertia. A dense load in the
middle contradicts this. Without the assumption both are estimated separately, with less accuracy.
"""

from dataclasses import replace

import matplotlib.pyplot as plt

import fifthwheel as fw
from fifthwheel.truck import laden

block = fw.vehicle("cheng_cebon_2011")
trailer = block.unit("semitrailer")
point = trailer.model_copy(update={"payload": trailer.payload.model_copy(update={"shape": "point"})})
true = block.model_copy(update={"units": (block.units[0], point)})
record = fw.simulate(true, count=5, seed=1)

settings = fw.OneStage(given={"others": "exact"}, tyres="linear")
assumed = fw.identify([record], block, settings)  # the vehicle file says: a uniform block
separate = fw.identify([record], block, replace(settings, uniform_payload=False))

# %%
# The point load has the same CoG, but less roll inertia than the block.

body = laden(true.parameters(), point)
true_values = {"semitrailer.cog_height": body.cog_height, "semitrailer.roll_inertia": body.roll_inertia}
results = {"uniform block": assumed, "any load": separate}
figure, axes = plt.subplots(1, 2, figsize=(8, 2.8), sharey=True, layout="constrained")
for axis, (name, value) in zip(axes, true_values.items(), strict=True):
    for row, (label, result) in enumerate(results.items()):
        estimate = result[name]
        axis.errorbar(estimate.value / value, row, xerr=2 * estimate.sigma / value, fmt="o", capsize=4)
        print(f"{name}, {label}: {estimate.value / value:.3f} +- {estimate.sigma / value:.3f} of the true value")
    axis.axvline(1, color="black", linewidth=0.8)
    axis.set(title=name, yticks=(0, 1), yticklabels=results, ylim=(-0.5, 1.5), xlabel="estimate / true value, 2 sigma")
plt.show()
