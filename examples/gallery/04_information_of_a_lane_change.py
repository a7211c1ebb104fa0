"""
Information of a lane change
============================

The sigma of every parameter can be predicted without a fit, from the vehicle file and the steer angle. Lane changes of
growing number show how far more data helps.
"""

import matplotlib.pyplot as plt

import fifthwheel as fw

truck = fw.vehicle("cheng_cebon_2011")
counts = (1, 2, 4, 8)
runs = [fw.simulate(truck, count=count, seed=1) for count in counts]
cases = {
    "everything else uncertain (default)": fw.OneStage(),
    "everything else exact": fw.OneStage(given={"others": "exact"}),
}
assessments = {label: [fw.predict_sigmas([run], truck, settings) for run in runs] for label, settings in cases.items()}

names = [parameter.name for parameter in assessments["everything else exact"][0].parameters]
figure, axes = plt.subplots(1, 2, figsize=(9, 3.8), sharey=True, layout="constrained")
for axis, (label, results) in zip(axes, assessments.items(), strict=True):
    for name in names:
        sigmas = [100 * result[name].sigma / result[name].value for result in results]
        axis.loglog(counts, sigmas, "o-", label=name)
    axis.set(title=label, xlabel="number of lane changes", xticks=counts, xticklabels=counts)
    axis.minorticks_off()
axes[0].set(ylabel="predicted sigma, % of the value", yticks=(0.5, 1, 2, 5, 10, 20), yticklabels=(0.5, 1, 2, 5, 10, 20))
axes[1].legend(fontsize="small")
plt.show()

# %%
# Sensor noise averages out (right). The uncertainty of masses, lengths, suspension and tyres does not (left): more lane
# changes do not help there, a better vehicle file does. The assessment names the measurements that help most:

for parameter in assessments["everything else uncertain (default)"][0].parameters:
    for remedy in parameter.remedies:
        known = " and ".join(remedy.known) or remedy.channel or "another manoeuvre"
        print(f"{parameter.name}: {parameter.sigma:.3g} -> {remedy.sigma:.3g} {parameter.unit} with {known}")
