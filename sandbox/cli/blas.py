"""One thread for BLAS, imported before numpy reads it: commands share the cores by threads and processes of their own,
and BLAS' threads wait beside them in a loop.  What the user has set stays."""

import os

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
