"""A program that multiplies matrices until its input ends; started by its path.

It imports nothing of the package, which would take many times as long as what is measured beside
it. Whoever started it ends it by closing its input, and it ends if they die.
"""

import select
import sys

import numpy as np

SIDE = 256
READY = b"ready\n"


def main() -> None:
    """Say that it burns, and burn."""
    matrix = np.full((SIDE, SIDE), 1.0 / SIDE)
    sys.stdout.buffer.write(READY)
    sys.stdout.buffer.flush()
    while not select.select([sys.stdin], [], [], 0.0)[0]:
        matrix = matrix @ matrix


if __name__ == "__main__":
    main()
