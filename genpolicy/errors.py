"""The exception tree: every error says where, what was found, what was expected and what to do.

Exit codes (one meaning each, everywhere): 0 done, 1 a fault of ours, 2 bad configuration or
bad input, 3 refused by a gate.
"""

from typing import ClassVar

DEAD_WORKER = ("BrokenProcessPool", "KilledWorker")
"""By name, the errors of a local pool and of a cluster of which a process was killed: nobody here
knows the module of the second before there is a cluster."""


class GenpolicyError(Exception):
    """Root of every error that the project raises on purpose."""

    exit_code: ClassVar[int] = 1


class BadInputError(GenpolicyError):
    """An input, a file or a setting breaks its contract.

    Args:
        where: The place: file, field, row, index.
        found: What stands there.
        expected: The rule that it breaks.
        action: What the reader should do next, a full sentence.
    """

    exit_code: ClassVar[int] = 2

    def __init__(self, *, where: str, found: str, expected: str, action: str) -> None:
        self.where = where
        self.found = found
        self.expected = expected
        self.action = action
        super().__init__(f"{where} is {found}, expected {expected}. {action}")

    def __reduce__(self) -> tuple[object, tuple[type["BadInputError"], dict[str, str]]]:
        """Keep the keyword-only fields when the error crosses a process boundary."""
        fields = {
            "where": self.where,
            "found": self.found,
            "expected": self.expected,
            "action": self.action,
        }
        return _rebuild, (type(self), fields)


class ConfigError(BadInputError):
    """`params.yaml`, or another settings file, breaks its schema."""


class ContractError(BadInputError):
    """Data break the dataset, observation, action or chunk contract."""


class NonFiniteError(ContractError):
    """A number that must be finite is NaN or infinite."""


class EvaluationCapError(ContractError):
    """A sampler asked for more network evaluations than it is allowed; there is no chunk."""


class IntegrityError(BadInputError):
    """Bytes differ from the hash that names them, or are not what they claim to be."""


class RefusedError(GenpolicyError):
    """A gate does not let the next stage begin.

    Args:
        gate: Letter of the gate that refuses, `A` to `E`.
        criterion: Identifier of the criterion (or check) that decided.
        measured: What was measured, as text.
        limit: The limit that it was held against, as text.
        report: Where the report lies.
        action: What to do next, a full sentence.
    """

    exit_code: ClassVar[int] = 3

    def __init__(
        self, *, gate: str, criterion: str, measured: str, limit: str, report: str, action: str
    ) -> None:
        self.gate = gate
        self.criterion = criterion
        self.measured = measured
        self.limit = limit
        self.report = report
        self.action = action
        super().__init__(
            f"Gate {gate} refuses: {criterion} is {measured}, required {limit}; "
            f"see {report}. {action}"
        )

    def __reduce__(self) -> tuple[object, tuple[type["RefusedError"], dict[str, str]]]:
        """Keep the keyword-only fields when the error crosses a process boundary."""
        fields = {
            "gate": self.gate,
            "criterion": self.criterion,
            "measured": self.measured,
            "limit": self.limit,
            "report": self.report,
            "action": self.action,
        }
        return _rebuild, (type(self), fields)


def _rebuild(kind: type[BadInputError | RefusedError], fields: dict[str, str]) -> GenpolicyError:
    return kind(**fields)
