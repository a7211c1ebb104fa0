"""
A CAN trace
===========

A trace of frames becomes signals by a database (DBC) and a signal map. Reading it needs
``pip install 'fifthwheel[can]'``.
"""

import struct
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import fifthwheel as fw

# %%
# A logger would write this trace. Here a simulated lane change is encoded: the steering wheel angle in degrees at a
# ratio of 20, positive to the right, and two gyros in deg/s with 16 bits.

DATABASE = """VERSION ""
BU_: ECU
BO_ 256 Drive: 8 ECU
 SG_ Speed : 0|16@1+ (0.01,0) [0|655] "km/h" ECU
 SG_ SteeringWheel : 16|16@1- (0.1,0) [-3276|3276] "deg" ECU
BO_ 257 Gyros: 8 ECU
 SG_ YawRateTractor : 0|16@1- (0.01,0) [-327|327] "deg/s" ECU
 SG_ YawRateTrailer : 16|16@1- (0.01,0) [-327|327] "deg/s" ECU
"""

folder = Path(tempfile.mkdtemp())
(folder / "truck.dbc").write_text(DATABASE)
run = fw.simulate(fw.vehicle("cheng_cebon_2011"), count=2, seed=1)
speed, steer = 3.6 * run.signals["speed"], -20 * np.degrees(run.signals["steer.tractor.front"])
yaw_rates = [np.degrees(run.signals[f"yaw_rate.{unit}"]) for unit in ("tractor", "semitrailer")]
with (folder / "run.log").open("w") as trace:  # the format of candump
    for time, u, angle, first, second in zip(run.time, speed, steer, *yaw_rates, strict=True):
        drive = struct.pack("<Hh4x", round(u / 0.01), round(angle / 0.1))
        gyros = struct.pack("<hh4x", round(first / 0.01), round(second / 0.01))
        trace.write(f"({1e9 + time:.6f}) can0 100#{drive.hex()}\n({1e9 + time + 2e-3:.6f}) can0 101#{gyros.hex()}\n")
print((folder / "run.log").read_text()[:140])

# %%
# The map names the database, and the column, unit, sign and ratio of each signal.

(folder / "signals.toml").write_text("""
databases = ["truck.dbc"]

[signals]
speed = "Drive.Speed"
"yaw_rate.tractor" = "Gyros.YawRateTractor"
"yaw_rate.semitrailer" = "Gyros.YawRateTrailer"

[signals."steer.tractor.front"]
column = "Drive.SteeringWheel"
sign = -1       # the log is positive to the right
gain = 0.05     # 1 / steering ratio
""")
record = fw.read_log(folder / "run.log", fw.SignalMap.load(folder / "signals.toml"))
print(record)

figure, (above, below) = plt.subplots(2, 1, figsize=(7, 4.5), sharex=True, layout="constrained")
above.plot(record.time, np.degrees(record.signals["steer.tractor.front"]))
above.set(ylabel="steer, deg", title="Signals of the CAN trace, in ISO 8855")
for name in ("yaw_rate.tractor", "yaw_rate.semitrailer"):
    measured = np.isfinite(record.signals[name])
    below.plot(record.time[measured], np.degrees(record.signals[name][measured]), label=name, linewidth=0.8)
below.set(ylabel="yaw rate, deg/s", xlabel="time, s")
below.legend(loc="upper right")
plt.show()
