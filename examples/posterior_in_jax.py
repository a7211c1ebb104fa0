"""The posterior of `identify` as a function of JAX: calls to the host with a derivative of their own."""

import jax
import numpy as np

import fifthwheel as fw

jax.config.update("jax_enable_x64", True)
truck = fw.vehicle("cheng_cebon_2011")
settings = fw.OneStage(given={"*": "exact", "tractor.front.cornering_stiffness": "free"}, tyres="linear")
density = fw.log_posterior([fw.simulate(truck, count=1)], truck, settings)


@jax.custom_vjp
def log_density(x):
    number = jax.ShapeDtypeStruct((), "float64")
    return jax.pure_callback(lambda x: np.float64(density(np.asarray(x))), number, x)


def forward(x):
    return log_density(x), x


def backward(x, factor):
    gradient = jax.pure_callback(lambda x: density.gradient(np.asarray(x)), x, x)
    return (factor * gradient,)


log_density.defvjp(forward, backward)
x = density.mean + 0.01
value, gradient = jax.jit(jax.value_and_grad(log_density))(x)
