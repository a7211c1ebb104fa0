"""
Near the limits of adhesion
===========================

On snow, or in a severe lane change, the side force of a tyre no longer grows with its slip angle. With tyres that
saturate, one log gives the friction of the road too, and the sideslip keeps its accuracy.
"""

import matplotlib.pyplot as plt
import numpy as np

import fifthwheel as fw
from fifthwheel.model.manoeuvres.open_loops import single_sine
from fifthwheel.model.plant import Plant, Properties

truck = fw.vehicle("cheng_cebon_2011")
snow = Plant(truck, Properties(friction=0.35))  # the tyres then have a peak friction of 0.25
record = snow.drive(single_sine(truck, acceleration=1.5)).record(seed=1)

# %%
# The log of the nonlinear truck has the noise of real gyros. ``auto`` compares both laws of the tyres; here we ask for
# each of them.

results = {tyres: fw.identify([record], truck, fw.OneStage(tyres=tyres)) for tyres in ("linear", "saturating")}
for tyres, result in results.items():
    print(f"{tyres}:")
    for e in result.parameters:
        print(f"  {e.name:36s}{e.value:12.4g} ± {100 * (e.sigma or 0) / e.value:3.0f} %  {e.verdict}")

# %%
# Sideslip of the trailer with the parameters of each identification, and a band of two sigma. The band of linear tyres
# is wide: the bank of the road is not known, and tyres that saturate reveal it.

name = "sideslip.semitrailer"
true = np.degrees(record.reference[name])
figure, (above, below) = plt.subplots(2, 1, figsize=(7, 5), sharex=True, layout="constrained")
above.plot(record.time, true, color="black", label="true")
for tyres, result in results.items():
    states = result.observer(log=record.name).batch(record, result.uncertainty(record.name))
    value, sigma = np.degrees(states.values[name]), np.degrees(states.sigma[name])
    above.plot(record.time, value, "--", label=tyres)
    (line,) = below.plot(record.time, value - true, label=f"{tyres}, rms {np.sqrt(np.mean((value - true) ** 2)):.2f}")
    below.fill_between(record.time, -2 * sigma, 2 * sigma, color=line.get_color(), alpha=0.15, linewidth=0)
above.set(ylabel="sideslip of the trailer, deg", title="Single sine of 0.36 g at the trailer, on snow")
below.set(ylim=(-1, 1), ylabel="error, deg", xlabel="time, s", title="Error, and a band of two sigma")
for axes in (above, below):
    axes.legend(loc="upper right")
plt.show()
