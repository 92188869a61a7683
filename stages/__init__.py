"""Stages of the ladder. One thread a process, set before any numeric library is loaded.

What is promised bit for bit is promised for one thread; the workers are processes. Torch keeps to
AVX2: with wider registers its sums depend on where a tensor lies in memory (decision 92).
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"
os.environ["ATEN_CPU_CAPABILITY"] = "avx2"
