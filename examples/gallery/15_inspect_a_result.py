"""
Inspect a result
================

A result has a joint posterior of all parameters and sensor errors, and the residuals that it is based on. The posterior
is a normal approximation; the density itself is a function, whose profiles show how good the approximation is.
"""

import matplotlib.pyplot as plt
import numpy as np

import fifthwheel as fw

truck = fw.vehicle("cheng_cebon_2011")
record = fw.simulate(truck, count=1, seed=1, name="lane change")
settings = fw.OneStage(tyres="linear")
result = fw.identify([record], truck, settings)

names = [parameter.name for parameter in result.parameters]
posterior = result.posterior.among(names)
print(posterior.to_pandas(level=0.9).to_string(float_format="{:.4g}".format))

# %%
# Correlations between parameters are part of the result: samples have them, and so has everything that is computed from
# samples. Whitened residuals of a model without error are white noise with variance 1.

draws = posterior.sample(2000, seed=0)
residuals = result.residuals(whitened=True)
figure, (left, middle, right) = plt.subplots(1, 3, figsize=(11, 3.3), layout="constrained")
shown = left.imshow(posterior.correlation(), vmin=-1, vmax=1, cmap="RdBu")
left.set(title="correlation", xticks=[], yticks=range(len(names)), yticklabels=names)
figure.colorbar(shown, ax=left)
stiffness, inertia = (names.index(f"semitrailer.{word}") for word in ("cornering_stiffness", "yaw_inertia"))
middle.plot(draws[:, stiffness] / 1e6, draws[:, inertia] / 1e3, ".", markersize=2)
middle.set(title="samples, trailer", xlabel="cornering stiffness, MN/rad", ylabel="yaw inertia, t m²")
size = np.linspace(-4, 4, 21)
for name, values in residuals.items():
    right.hist(values.dropna(), size, density=True, histtype="step", label=name)
right.plot(size, np.exp(-(size**2) / 2) / np.sqrt(2 * np.pi), "k--", linewidth=1)
right.set(title="whitened residuals", xlabel="standard deviations")
right.legend(fontsize="xx-small")
plt.show()

# %%
# The density as a function, for a sampler such as emcee or an optimiser of SciPy, has the gradient, the information of
# the logs and a start with it. Its coordinates are those of the estimator: logarithms of positive parameters, in
# standard deviations of the priors. An ensemble sampler needs at least twice as many walkers as there are unknowns.
# Fewer unknowns make a chain shorter: ``given`` takes all other numbers and the sensors as exact. The initial states
# stay.
#
# .. code-block:: python
#
#     import emcee
#
#     settings = fw.OneStage(given={"*": "exact"} | dict.fromkeys(names[:3], "free"), tyres="linear")
#     density = fw.log_posterior([record], truck, settings)
#     rng, walkers = np.random.default_rng(1), 2 * len(density.names) + 2
#     start = rng.multivariate_normal(density.mean, density.covariance, size=walkers)
#     sampler = emcee.EnsembleSampler(walkers, len(density.names), density)
#     sampler.run_mcmc(start.clip(*density.bounds), 5000)
#     stiffness = density.values(sampler.get_chain(flat=True))["semitrailer.cornering_stiffness"]
#
# The profile is the density along one unknown, with all others estimated again at each point.

density = fw.log_posterior([record], truck, settings)
profile = density.profile("semitrailer.payload.height", points=9)
print("90 % interval of the payload height, m:", profile.interval(0.9).round(2))
plot = profile.plot()
