"""
What a truck does
=================

``fw.assess`` gives performance-based measures with sigma: rollover threshold, rearward amplification, off-tracking. The
sigma comes from the vehicle file, or from the joint covariance of an identification.
"""

import matplotlib.pyplot as plt
import numpy as np

import fifthwheel as fw

truck = fw.vehicle("cheng_cebon_2011")
body = {"half_track": "1.02 m +- 1 %", "rear_overhang": "2.7 m"}
print(fw.assess(truck, body=body, nonlinear=False))

# %%
# A log of lane changes contains information on the tyres. It reduces the sigma of the measures that depend on them.

result = fw.identify([fw.simulate(truck, count=4, seed=1)], truck)
for name, subject in (("vehicle file", truck), ("identified", result)):
    print(f"{name:12s} {fw.assess(subject, body=body, cheap=True)['rearward_amplification_peak'].text()}")

# %%
# A higher load rolls over earlier. Wheels lift before the truck rolls over.

heights = np.linspace(0.8, 2.6, 7)
assessments = [
    fw.assess(truck, body=body, changes={"semitrailer.payload.height": height}, cheap=True) for height in heights
]
figure, axes = plt.subplots(figsize=(6, 3.4), layout="constrained")
for name, label in (("rollover_threshold", "rollover"), ("wheel_lift.semitrailer", "trailer wheels lift")):
    measures = [assessment[name] for assessment in assessments]
    axes.errorbar(heights, [m.value for m in measures], [m.sigma for m in measures], capsize=3, label=label)
axes.axhline(0.35, color="grey", linestyle="--", label="threshold")
axes.set(xlabel="payload height, m", ylabel="lateral acceleration, g")
axes.legend()
plt.show()
