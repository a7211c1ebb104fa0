"""One stage: the maximum a posteriori estimate of all unknowns together, over complete logs."""
