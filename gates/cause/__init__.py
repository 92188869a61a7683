"""Why demonstrations differ where the observation does not: named here, from the audit's numbers.

One function and one set of limits for Gate A, the command `genpolicy audit` and the audit's page.
"""

from gates.cause.limits import CauseLimits, Limit, default_limits, limits_of
from gates.cause.naming import (
    Answer,
    Cause,
    CauseName,
    Topic,
    cause_of,
    deciding_answer,
    name_cause,
)
from gates.cause.numbers import Numbers
from gates.cause.reading import read_measured, read_numbers

__all__ = [
    "Answer",
    "Cause",
    "CauseLimits",
    "CauseName",
    "Limit",
    "Numbers",
    "Topic",
    "cause_of",
    "deciding_answer",
    "default_limits",
    "limits_of",
    "name_cause",
    "read_measured",
    "read_numbers",
]  # fmt: skip
