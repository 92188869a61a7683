"""One latency measurement in a process of its own: `python -m <this module>`.

From a program, `in_fresh_process` calls any top-level function in a new interpreter; a stage
uses it to time a projection too, which no command line can name.
"""

import argparse
import multiprocessing
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from pathlib import Path
from typing import ParamSpec, TypeVar

import numpy as np
import pyarrow as pa

from genpolicy.errors import GenpolicyError
from genpolicy.evidence.reproducibility.benchmark import Measurement, measure_policy
from genpolicy.integrity.tables import write_table

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def in_fresh_process(
    function: Callable[Arguments, Result], *args: Arguments.args, **kwargs: Arguments.kwargs
) -> Result:
    """`function(*args, **kwargs)` in a new interpreter, which ends afterwards.

    Args:
        function: A top-level function.
        args: Its arguments.
        kwargs: Its keyword arguments.
    """
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(max_workers=1, mp_context=context) as pool:
        return pool.submit(function, *args, **kwargs).result()


def as_table(measurements: list[Measurement]) -> pa.Table:
    """Columns component, temperature, repeat, seconds."""
    return pa.Table.from_pylist([asdict(measurement) for measurement in measurements])


def main(arguments: list[str]) -> int:
    """Command line; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m genpolicy.evidence.reproducibility.measure",
        description="Cold and warm latency of one checkpoint, in this process.",
    )
    parser.add_argument("--checkpoint", type=Path, required=True, help="checkpoint folder")
    parser.add_argument("--expected-sha256", required=True, help="identity of the checkpoint")
    parser.add_argument(
        "--observations", type=Path, required=True, help=".npy file of shape (M, H_o, D_o)"
    )
    parser.add_argument("--out", type=Path, required=True, help="Parquet table to write")
    parser.add_argument("--cold", type=int, default=5, help="cold invocations")
    parser.add_argument("--warm", type=int, default=200, help="warm invocations")
    parser.add_argument("--device", default="cpu")
    options = parser.parse_args(arguments)
    try:
        observations = np.load(options.observations, allow_pickle=False)
        measurements = measure_policy(
            options.checkpoint,
            observations,
            expected_sha256=options.expected_sha256,
            device=options.device,
            cold_repeats=options.cold,
            warm_repeats=options.warm,
        )
        write_table(options.out, as_table(measurements))
    except GenpolicyError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
