"""
Handling of a truck
===================

The linear model at one speed is a ``LinearSystem`` with named inputs and outputs. ``fw.plot`` draws it: Bode diagram,
modes, responses, handling diagram.
"""

import matplotlib.pyplot as plt
import numpy as np

import fifthwheel as fw
from fifthwheel.model import dynamics

truck = fw.vehicle("cheng_cebon_2011")
system = fw.linear_system(truck, 88 / 3.6)
bode = fw.plot.bode(system, ["yaw_rate.tractor", "yaw_rate.semitrailer"])

# %%
# The handling diagram compares the model with a log. Straight running and the steady bend lie on its line.

bend = fw.simulate(truck, manoeuvre="bend", speed=25.0, sensors={"yaw_rate.tractor": 1e-8})
handling = fw.plot.handling_diagram(truck, [bend])

# %%
# Softer tyres on the trailer increase the rearward amplification and reduce the damping of its yaw mode.

speeds = np.arange(40, 121, 10)
stiffness = truck.parameters()["semitrailer.cornering_stiffness"]
figure, axes = plt.subplots(1, 2, figsize=(8, 3.2), layout="constrained")
for factor in (0.7, 1.0, 1.3):
    variant = truck.replace({"semitrailer.cornering_stiffness": factor * stiffness})
    amplification = [dynamics.rearward_amplification(variant, speed / 3.6)[0] for speed in speeds]
    modes = [[mode for mode in dynamics.modes(variant, speed / 3.6) if mode.frequency < 1] for speed in speeds]
    damping = [min(mode.damping for mode in slow) for slow in modes]
    axes[0].plot(speeds, amplification, label=f"{factor:.0%} of the trailer's stiffness")
    axes[1].plot(speeds, damping)
axes[0].set(xlabel="speed, km/h", title="rearward amplification (ISO 14791)")
axes[1].set(xlabel="speed, km/h", title="damping ratio of the yaw mode")
axes[0].legend(fontsize="small")
plt.show()
