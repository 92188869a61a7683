"""What an update costs, and what several seeds cost together.

Set before anything is imported that computes: the processor capability with which stages train,
and that threads which wait for each other sleep. By default they spin, and on a machine that is
shared one spins for another that does not run.
"""

import os

os.environ.setdefault("ATEN_CPU_CAPABILITY", "avx2")
os.environ.setdefault("OMP_WAIT_POLICY", "passive")
