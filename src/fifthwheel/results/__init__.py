"""What follows from an estimate: performance measures, test methods, C and FMU, diagnosis, reports."""
