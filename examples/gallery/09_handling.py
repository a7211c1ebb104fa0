"""
Handling of the identified truck
================================

The linear model gives frequency responses, the rearward amplification and the damping of every mode at any speed.
"""

import matplotlib.pyplot as plt
import numpy as np

from fifthwheel import dynamics, vehicle

truck = vehicle.get("cheng_cebon_2011")
frequency = np.geomspace(0.05, 3, 200)
response = dynamics.frequency_response(truck, 88 / 3.6, frequency)[:, :, 0]
states = dynamics.state_names(truck, roll=True)

figure, axes = plt.subplots(2, 1, figsize=(7, 5), sharex=True, layout="constrained")
for unit in ("tractor", "semitrailer"):
    gain = response[:, states.index(f"yaw_rate.{unit}")]
    axes[0].loglog(frequency, np.abs(gain), label=unit)
    axes[1].semilogx(frequency, np.degrees(np.unwrap(np.angle(gain))), label=unit)
axes[0].set(ylabel="gain, 1/s", title="From the steer angle to the yaw rates at 88 km/h")
axes[1].set(ylabel="phase, deg", xlabel="frequency, Hz")
axes[0].legend()
plt.show()

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
axes[1].set(xlabel="speed, km/h", title="damping ratio of the yaw mode (below 1 Hz)")
axes[0].legend(fontsize="small")
plt.show()
