"""Stage `gate_b`: judge gate B from its evidence and write its report."""

from stages._gate import judge
from stages._stage import Params, main


def work(params: Params) -> None:
    """Judge; a FAIL is a result, not an error."""
    judge("B", params)


if __name__ == "__main__":
    main("gate_b", work)
