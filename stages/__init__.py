"""Stages of the ladder. One thread a process, set before any numeric library is loaded.

What is promised bit for bit is promised for one thread; the workers are processes.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"
