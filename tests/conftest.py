"""Settings of all tests: one thread for BLAS in each test process, because its threads only spin on thin matrices."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
