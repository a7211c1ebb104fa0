"""
Your own filter
===============

The matrices of the linear model are NumPy arrays, so any filter can be tried on them. Here a steady Kalman filter in
a few lines of SciPy, against the observer of fifthwheel.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.linalg import expm, solve_discrete_are

import fifthwheel as fw
from fifthwheel.model import dynamics

truck = fw.vehicle("cheng_cebon_2011")
record = fw.simulate(truck, count=2, seed=3)
speed, step = record.signals["speed"][0], 0.01

# %%
# Model: states by name, and the exact discretisation for a steer angle that is constant within a step.

model = dynamics.matrices(truck, speed, roll=True)
n = len(model.states)
block = expm(np.block([[model.A, model.B[:, :1]], [np.zeros((1, n + 1))]]) * step)
F, G = block[:n, :n], block[:n, n]
channels = ["yaw_rate.tractor", "yaw_rate.semitrailer", "roll_rate.tractor", "roll_rate.semitrailer"]
H = np.eye(n)[[model.states.index(name) for name in channels]]

# %%
# Filter: the gain of the steady state, by the Riccati equation.

Q = np.diag([1e-6 if name.startswith(("lateral", "yaw")) else 1e-10 for name in model.states])
R = np.diag([np.var(record.signals[name][:50]) for name in channels])
P = solve_discrete_are(F.T, H.T, Q, R)
gain = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
x, estimates = np.zeros(n), []
steer = record.signals["steer.tractor.front"]
measured = np.column_stack([record.signals[name] for name in channels])
for k in range(len(record)):
    x = F @ x + G * steer[max(k - 1, 0)]
    x = x + gain @ (measured[k] - H @ x)
    estimates.append(x)
mine = np.array(estimates)[:, model.states.index("lateral_velocity.tractor")] / speed

observer = fw.Observer(truck, ["speed", "steer.tractor.front", *channels])
theirs = observer.batch(record).values["sideslip.tractor"]

true = record.reference["sideslip.tractor"]
figure, axes = plt.subplots(2, 1, figsize=(7, 4.5), sharex=True, layout="constrained")
axes[0].plot(record.time, np.degrees(true), color="black", label="true")
for label, values in (("own filter", mine), ("Observer", theirs)):
    axes[0].plot(record.time, np.degrees(values), "--", label=label)
    axes[1].plot(record.time, np.degrees(values - true), label=label)
axes[0].set(title="Sideslip of the tractor", ylabel="deg")
axes[1].set(xlabel="time, s", ylabel="error, deg")
axes[0].legend(loc="upper right")
plt.show()
