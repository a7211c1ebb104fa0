"""The linear model of a chain of units, manoeuvres, simulation, and the nonlinear truck."""
