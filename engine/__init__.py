"""The estimation engine: scenario -> mission -> log -> estimators -> tracks -> metrics and claims."""

import os

# Before NumPy is loaded: our matrices are small and trials run in parallel processes, so the linear algebra library's
# own threads would only wait for each other, milliseconds at a time on a busy machine.
for _threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_threads, "1")

__version__ = "0.1.0"
