"""Was a chunk made by feasibility? Asked by those who must not load it, stub and arrivals."""

import sys
from typing import Any

MAKER = "genpolicy.feasibility.admission"


def issued_by_feasibility(chunk: Any) -> bool:
    """Whether the feasibility module made this very object, and nothing of it was changed.

    Where that module was never loaded nothing can have been made by it, so that the controller
    stub need not import it to ask.
    """
    maker = sys.modules.get(MAKER)
    if maker is None or type(chunk) is not maker.Admitted:
        return False
    try:
        chunk.verify()
    except Exception:  # of what was bent behind its back, reading may raise anything
        return False
    return True
