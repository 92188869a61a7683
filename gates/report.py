"""The gate report: what was measured, held against which limit, and what follows from it.

Reports are canonical JSON without a timestamp, so that equal evidence gives equal bytes.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from genpolicy.errors import BadInputError, ConfigError, IntegrityError
from genpolicy.integrity.documents import canonical_json, parse_json
from genpolicy.integrity.hashing import sha256_bytes_of

SCHEMA_VERSION = 4

Gate = Literal["A", "B", "C", "D", "E"]
Owner = Literal["model", "perception", "controller", "safety"]
Comparison = Literal["<=", ">="]
Verdict = Literal["PASS", "FAIL", "INCONCLUSIVE", "PENDING_REVIEW"]

GATES: tuple[Gate, ...] = ("A", "B", "C", "D", "E")
OWNERS: tuple[Owner, ...] = ("model", "perception", "controller", "safety")
NAMES: dict[Gate, str] = {
    "A": "need",
    "B": "reproducibility",
    "C": "feasibility and time",
    "D": "matched simulation and stress",
    "E": "trial card",
}

Point = tuple[float, float, float]


class StrictModel(BaseModel):
    """Frozen settings or documents: no unknown key, no coercion, no NaN."""

    model_config: ClassVar[ConfigDict] = ConfigDict(
        extra="forbid", frozen=True, strict=True, allow_inf_nan=False
    )


Model = TypeVar("Model", bound=StrictModel)


class Recount(StrictModel):
    """How a number is counted again from the rows of a table.

    Attributes:
        table: Path of the table.
        method: Whose rows they are; empty where they are of several, or of none.
        where: What holds of each row that counts, as it is typed into a filter; empty where all do.
        columns: Columns that this needs.
        of: Column that is added up to the whole; empty where rows are counted.
        whole: The rows, or the sum over them.
        hits: What holds, further, of each row that is a hit.
        summed: Columns that are added up to the part.
        part: The hits, or the sum over the rows; None where rows alone are counted.
    """

    table: str
    method: str
    where: tuple[str, ...]
    columns: tuple[str, ...]
    of: str
    whole: float
    hits: tuple[str, ...]
    summed: tuple[str, ...]
    part: float | None


class Answer(StrictModel):
    """One criterion of a gate, answered.

    Attributes:
        id: Name of the criterion; the key of its limit in `params.yaml`.
        owner: Who answers for the limit; None where `params.yaml` has none.
        candidate: Method it speaks of; None for the whole gate.
        measured: Number held against the limit; None where evidence is missing.
        interval: Interval of what was measured, where it has one.
        threshold: The limit; None where `params.yaml` has none.
        comparison: How `measured` must stand to `threshold`.
        reason: Why the limit is what it is.
        evidence: Files that were read for the number, relative to the repository.
        caveat: What the reader must know about this number.
        counted: The independent units that the number rests on; empty where it counts none.
        recount: How its rows are found and counted again; None where it counts no rows of a table.
    """

    id: str
    question: str
    owner: Owner | None
    candidate: str | None
    measured: float | None
    interval: tuple[float, float] | None
    threshold: float | None
    comparison: Comparison
    reason: str
    verdict: Verdict
    evidence: tuple[str, ...]
    caveat: str
    counted: str
    recount: Recount | None = None


class Overridden(StrictModel):
    """A limit that somebody let be looser for a while, and what it would have been without.

    Attributes:
        gate: Whose limit it is.
        criterion: Of that gate.
        candidate: Of whom it is asked; None for the whole gate.
        comparison: How what is measured must stand to the limit.
        threshold: The limit of `params.yaml`.
        limit: What stands in its place.
        by: Who did so, by the identifier on `reviewers.yaml`.
        reason: Why.
        expires: Last day on which it holds, YYYY-MM-DD.
        verdict: Of the criterion by its own limit; None where it was not asked.
        instead: Of the criterion by the looser limit; likewise.
        without: Of the gate, had nobody overridden anything.
    """

    gate: Gate
    criterion: str
    candidate: str | None
    comparison: Comparison
    threshold: float
    limit: float
    by: str
    reason: str
    expires: str
    verdict: Verdict | None
    instead: Verdict | None
    without: Verdict


class GateReport(StrictModel):
    """The answer of one gate.

    Attributes:
        schema_version: Version of this model.
        verdict: Follows from the criteria by `gates.verdicts.combine`, those that are overridden
            by the looser limit.
        candidates: Verdict of each method that stands for promotion (gates B to E).
        criteria: In the order in which a failure is diagnosed; each by its own limit, overridden
            or not.
        overrides: Limits that somebody overrides, of this gate and of those below.
        materials: SHA-256 of every file read or bound, by path relative to the repository.
        upstream: SHA-256 of the reports below this one, by gate.
        code: SHA-256 of the code that the gate and its evidence stages depend on, by package.
        parameters: SHA-256 of what the evidence stages read of `params.yaml`, by key.
        pipeline: SHA-256 of the recorded run (`dvc.lock`) of each evidence stage.
        settings: The gate's parameters other than limits (levels, margins, candidates).
        environment: Library versions and regime.
        caveats: What this gate does not show.
        diagnosis: Where to look first; empty after PASS.
        decision: What to do next.
        promoted: The method that the gate promotes; only Gate D promotes, and only after PASS.
    """

    schema_version: int
    gate: Gate
    verdict: Verdict
    candidates: dict[str, Verdict]
    criteria: tuple[Answer, ...]
    materials: dict[str, str]
    upstream: dict[str, str]
    code: dict[str, str]
    parameters: dict[str, str]
    pipeline: dict[str, str]
    settings: dict[str, Any]
    environment: dict[str, str]
    caveats: tuple[str, ...]
    diagnosis: str
    decision: str
    promoted: str | None
    overrides: tuple[Overridden, ...] = ()


def report_path(gate: str) -> str:
    """Path of a gate's JSON report, relative to the repository."""
    return f"reports/gate_{gate.lower()}.json"


def stage_of(gate: str) -> str:
    """Name of the stage that judges a gate."""
    return f"gate_{gate.lower()}"


def folder_of(stage: str) -> str:
    """Folder of evidence that a stage writes, relative to the repository."""
    return f"artifacts/{stage}"


def writer_of(path: str) -> str:
    """Name of the stage that writes a file `artifacts/<folder>/...`."""
    return path.split("/")[1]


def report_bytes(report: GateReport) -> bytes:
    """The one serialisation of a report."""
    return canonical_json(report.model_dump(mode="json"))


def read_report(root: Path, gate: str) -> tuple[GateReport, str]:
    """A gate's report and the SHA-256 of its bytes.

    Raises:
        IntegrityError: Missing, malformed, of another schema version or of another gate.
    """
    path = root / report_path(gate)
    digest, data = sha256_bytes_of(path, keep=True)
    return parse_report(data, gate=gate), digest


def parse_report(data: bytes, *, gate: str) -> GateReport:
    """The report in `data`.

    Raises:
        IntegrityError: Malformed (duplicate keys and NaN included), of another schema version
            or of another gate.
    """
    where = report_path(gate)
    action = f"Run `dvc repro -f {stage_of(gate)}` to judge the evidence again."
    try:
        document = parse_json(data, where=where)
    except BadInputError as error:
        raise IntegrityError(
            where=where, found=error.found, expected=error.expected, action=action
        ) from error
    version = document.get("schema_version") if isinstance(document, dict) else None
    if version != SCHEMA_VERSION or isinstance(version, bool):
        raise IntegrityError(
            where=f"{where}: schema_version",
            found=repr(version),
            expected=str(SCHEMA_VERSION),
            action=action,
        )
    try:
        report = GateReport.model_validate_json(data)
    except ValidationError as error:
        raise IntegrityError(
            where=f"{where}: {place(error)}",
            found=message(error),
            expected="a gate report",
            action=action,
        ) from error
    if report.gate != gate:
        raise IntegrityError(
            where=f"{where}: gate",
            found=f"a report of gate {report.gate}",
            expected=f"gate {gate}",
            action=action,
        )
    return report


def parse_section(
    model: type[Model],
    section: object,
    *,
    where: str,
    homes: Mapping[str, str] | None = None,
) -> Model:
    """A settings section as its model; lists may stand for tuples, nothing else is coerced.

    Args:
        model: The model.
        section: The section.
        where: Its place, for the error.
        homes: Places of keys that stand elsewhere, by key.

    Raises:
        ConfigError: The section breaks the model.
    """
    try:
        return model.model_validate_json(canonical_json(section))
    except ValidationError as error:
        key, *deeper = place(error).split(".")
        home = (homes or {}).get(key)
        raise ConfigError(
            where=".".join([home or f"{where}.{key}", *deeper]),
            found=message(error),
            expected="the keys and types of its model",
            action="Correct the section; no unknown keys, no text for numbers.",
        ) from error
    except (BadInputError, TypeError, ValueError) as error:
        raise ConfigError(
            where=where,
            found=f"not a plain settings section ({' '.join(str(error).split())})",
            expected="mappings, lists, text and finite numbers",
            action="Correct the section.",
        ) from error


def place(error: ValidationError) -> str:
    """Dotted path of the first field that breaks a model."""
    return ".".join(str(part) for part in error.errors()[0]["loc"]) or "document"


def message(error: ValidationError) -> str:
    """First complaint of a validation error, in one line, without the value's address."""
    first = error.errors(include_url=False, include_context=False)[0]
    return f"{str(first.get('input'))[:60]!r} ({first['msg']})"
