"""Settings of Gate B, and where its evidence lies."""

import datetime
from collections.abc import Collection, Mapping
from typing import ClassVar

from pydantic import Field, field_validator, model_validator

from gates.evidence import Evidence, MissingEvidenceError, numbers
from gates.may_differ import PLACE, Listed
from gates.report import Owner, StrictModel
from gates.settings import CandidateSettings
from genpolicy.evidence.rows.reproducibility import NfeRow, SampleRow

RELOAD = "artifacts/reload"
SAMPLES = f"{RELOAD}/samples.parquet"
COVERAGE = f"{RELOAD}/coverage.parquet"
MODES = f"{RELOAD}/modes.parquet"
NFE = f"{RELOAD}/nfe.parquet"
MODES_EARLIER = f"{RELOAD}/modes_earlier.parquet"
DENSITY = f"{RELOAD}/density.parquet"
GENERATORS = "artifacts/train_generators"
BROUGHT_FOLDER = "artifacts/candidates"


MATCHING = ("unmatched_keys", "parameter_budget_deviation", "late_change_upper")
"""What asks whether a comparison is matched; of whoever was brought it may stay unasked."""


CONFORMANCE = "conformance"
"""What is asked of who was brought only: what is trained here has its units from the dataset."""


class Unmatched(StrictModel):
    """The written exception of a candidate that was brought: it is compared, and not matched.

    Attributes:
        owner: Who answers for it.
        reason: Why it may be compared although it was trained in another way.
        expires: Last day on which it holds, as YYYY-MM-DD; no card may outlive it.
    """

    owner: Owner
    reason: str = Field(pattern=r"\S")
    expires: str = Field(pattern=r"^\d{4}-\d{2}-\d{2}$")

    @field_validator("expires")
    @classmethod
    def _a_day(cls, value: str) -> str:
        datetime.date.fromisoformat(value)
        return value


def of_nobody(excepted: Collection[str], brought: Collection[str]) -> list[str]:
    """Names of exceptions that are of nobody who was brought: what is trained here is matched."""
    return sorted(set(excepted) - set(brought))


class ReproducibilitySettings(CandidateSettings):
    """Settings of Gate B other than limits.

    Attributes:
        baselines: Simpler methods that candidates will be compared with.
        device: Torch device on which what is trained here is asked.
        term_deadlines: Of each latency term, what it may take, s, and what is done beyond.
        may_differ: Settings that may differ between methods, each with its reason.
        budget_reference: Method whose parameter count is the budget.
        mode_minimum_share: Share of the samples of a situation that must be admissible and reach
            a mode, for that mode to be covered.
        unmatched: Exceptions of candidates that were brought, by name.
        fixtures: Observations whose samples must come back after reload.
        seeds: Numbers of the training seeds; the first is the one that is promoted.
        warm: Warm invocations of each timed process.
        cold: Cold invocations of each timed process.
        declared: Least and most of each term that this machine cannot measure, s.
        samples: Candidates drawn at each two-mode situation.
        invocation_candidates: Candidates that an invocation draws where it is deployed.
        deadline_s: After which an answer is given up, s.
        replan_lead_rows: Executable actions left at which the executor asks again.
    """

    homes: ClassVar[Mapping[str, str]] = {
        **CandidateSettings.homes,
        "baselines": "stress.baselines",
        "device": "compute.device",
        "may_differ": PLACE,
        "term_deadlines": "execution.term_deadlines",
        "fixtures": "policy.fixtures",
        "seeds": "policy.seeds",
        "warm": "latency.warm",
        "cold": "latency.cold",
        "declared": "latency.declared",
        "samples": "reload.samples",
        "invocation_candidates": "stress.samples",
        "deadline_s": "execution.deadline_s",
        "replan_lead_rows": "execution.replan_lead_rows",
    }
    whole: ClassVar[frozenset[str]] = frozenset({"declared"})

    baselines: tuple[str, ...] = Field(min_length=1)
    device: str
    term_deadlines: tuple[tuple[str, float, str], ...]
    may_differ: Listed
    budget_reference: str
    mode_minimum_share: float = Field(gt=0.0, le=0.5)
    unmatched: dict[str, Unmatched] = Field(default_factory=dict)
    fixtures: int = Field(ge=1)
    seeds: tuple[int, ...] = Field(min_length=1)
    warm: int = Field(ge=1)
    cold: int = Field(ge=1)
    declared: dict[str, tuple[float, float]]
    samples: int = Field(ge=1)
    invocation_candidates: int = Field(ge=1)
    deadline_s: float = Field(gt=0.0)
    replan_lead_rows: int = Field(ge=0)

    @model_validator(mode="after")
    def _exceptions_of_brought(self) -> "ReproducibilitySettings":
        if others := of_nobody(self.unmatched, self.brought):
            raise ValueError(
                f"{', '.join(others)} is excepted and not among `candidates`; what is trained here "
                "is matched"
            )
        return self

    def excepted(self, criterion: str, candidate: str | None) -> bool:
        """Whether matching is excepted, or what only those that were brought are asked."""
        if criterion == CONFORMANCE:
            return candidate not in self.brought
        return criterion in MATCHING and candidate in self.unmatched

    @property
    def caveats(self) -> tuple[str, ...]:
        """Who is not matched, and who answers for it until when."""
        return tuple(
            f"{name} is unmatched evidence: it was trained elsewhere, and {', '.join(MATCHING)} "
            f"were not asked of it. The {entry.owner} owner answers for it until {entry.expires}: "
            f"{entry.reason}."
            for name, entry in sorted(self.unmatched.items())
        )


def allowed_nfe(evidence: Evidence, candidate: str) -> tuple[float, float]:
    """Fewest and most network evaluations of a sample that its sampler's definition allows.

    Raises:
        MissingEvidenceError: None, or others of one training seed than of another.
    """
    rows = evidence.of(NFE, NfeRow, candidate)
    pairs = set(zip(numbers(rows, "least"), numbers(rows, "most"), strict=True))
    if len(pairs) != 1:
        raise MissingEvidenceError(f"{NFE} allows {candidate} several counts of evaluations")
    return next(iter(pairs))


def chosen_nfe(evidence: Evidence, candidate: str) -> tuple[float, float]:
    """Fewest and most network evaluations that a sample of the candidate may take.

    Both are what it records, unless its sampler chooses its steps by itself: then what it takes
    differs with the observation, and the definition says from where to where.

    Raises:
        MissingEvidenceError: None, or several of a sampler that always takes the same.
    """
    least, most = allowed_nfe(evidence, candidate)
    if least < most:
        return least, most
    recorded = numbers(evidence.of(NFE, NfeRow, candidate), "recorded")
    lowest, highest = float(recorded.min()), float(recorded.max())
    if lowest != highest:
        raise MissingEvidenceError(f"{candidate} records several NFE: {lowest:g} to {highest:g}")
    return lowest, highest


def fixtures_of(evidence: Evidence, candidate: str) -> dict[int, int]:
    """How many fixtures of each training seed a candidate was asked for."""
    rows = evidence.of(SAMPLES, SampleRow, candidate)
    counted = rows.groupby("seed")["row"].nunique()
    return dict(zip(counted.index.tolist(), counted.tolist(), strict=True))
