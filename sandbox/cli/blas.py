"""One thread for BLAS, imported before numpy reads it: commands share the cores by threads and
processes of their own, and BLAS' threads wait beside them in a loop.  Where the user has set a
number of threads, nothing is changed."""

import os

NAMES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")

if not any(name in os.environ for name in NAMES):
    os.environ |= dict.fromkeys(NAMES, "1")
