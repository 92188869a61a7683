"""Runs a stage that stands beside the ladder: behind a promotion, and no gate asks for it.

`stages._stage` counts the stages that lead to verdicts, and what trains depends on that file: a
name more in it would train everything again. Such a stage writes its folder, leaves with the same
exit codes, and has its settings in a section of another stage.
"""

import contextlib
import os
import sys
import time
import traceback
from collections.abc import Callable
from typing import NoReturn

from genpolicy.errors import GenpolicyError
from genpolicy.progress import LOG_EVERY_S, STAGE, still_at_it
from stages._stage import TIMES, Params, _record, _taken, load_params, unexpected


def main(name: str, work: Callable[[Params], None], *, writes: bool = True) -> NoReturn:
    """Run the body of stage `name` and leave with the exit code that its end deserves.

    Args:
        name: As `dvc.yaml` has it.
        work: Admits, measures, and writes the outputs.
        writes: Whether this is a run of the stage; what only looks leaves no record of one.
    """
    started = time.perf_counter()
    usual_s = _taken(name)
    if writes:
        with contextlib.suppress(OSError):
            (TIMES / f"{name}.json").unlink(missing_ok=True)
    os.environ[STAGE] = f"[beside] {name}"
    code = 0
    try:
        with still_at_it(usual_s, every_s=LOG_EVERY_S):
            work(load_params())
    except GenpolicyError as error:
        print(f"{name}: {error}", file=sys.stderr)
        code = error.exit_code
    except Exception as error:
        traceback.print_exc()
        print(f"{name}: {unexpected(error)}", file=sys.stderr)
        code = 1
    if writes:
        _record(name, started, code)
    sys.exit(code)
