"""Where the worker processes of our own cluster come from: a process that has imported everything once, and is copied.

A worker is at work a moment after it was wanted, when the server starts and whenever one was killed.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
from multiprocessing import forkserver

#: How a worker process begins. Apple's libraries do not bear being copied.
METHOD = "spawn" if sys.platform == "darwin" else "forkserver"
#: What has to be so before a worker process imports anything. One thread each, for there is one worker per core. Dask
#: makes glibc give memory back at once, which costs arrays of many megabytes a third of their speed.
ENVIRONMENT = {
    "MALLOC_TRIM_THRESHOLD_": str(2**28),
    "MALLOC_MMAP_THRESHOLD_": str(2**26),
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "PYTHONHASHSEED": "6640",
}


def prepare() -> None:
    """Begin with the imports, in a process beside this one; workers that are wanted earlier wait for them."""
    if METHOD != "forkserver":
        return
    multiprocessing.get_context(METHOD).set_forkserver_preload(["server.newborn"])
    outside = {name: os.environ.get(name) for name in ENVIRONMENT}
    os.environ.update(ENVIRONMENT)
    try:
        forkserver.ensure_running()
    finally:
        for name, value in outside.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
