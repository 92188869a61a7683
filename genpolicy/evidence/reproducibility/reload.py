"""Gate B's evidence: does a checkpoint come back the same, and what does fewer NFE cost?"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from genpolicy.candidates.answering import AnsweringPolicy
from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.judged import JudgedPolicy, loaded_on, sampling_by
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.data.dataset import Dataset, load_dataset
from genpolicy.errors import ContractError
from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.documents.brought import FAULTS
from genpolicy.evidence.documents.conformance import CONFORMANCE, Conformance
from genpolicy.evidence.documents.reproducibility import CANDIDATES, CandidateIdentity
from genpolicy.evidence.need.held_out import HeldOut, held_out_situations, modes_of_policy
from genpolicy.evidence.need.offline import offline_rows
from genpolicy.evidence.reproducibility.brought import Answered, Asked, ask_brought
from genpolicy.evidence.reproducibility.compute import compute_rows
from genpolicy.evidence.reproducibility.fixtures import fixtures_again
from genpolicy.evidence.reproducibility.identity import Deployment, identities
from genpolicy.evidence.reproducibility.likelihood import density_rows, drawn_situations
from genpolicy.evidence.reproducibility.measure import in_fresh_process
from genpolicy.evidence.reproducibility.sweep import (
    Quality,
    coverage_row,
    quality_of,
    swept_windows,
)
from genpolicy.evidence.reproducibility.swept import Sweep, swept_samplers
from genpolicy.evidence.reproducibility.variations import trained_otherwise
from genpolicy.evidence.rows.brought import AnswerRow
from genpolicy.evidence.rows.need import ModeRow, OfflineRow
from genpolicy.evidence.rows.reproducibility import (
    ComputeRow,
    CoverageRow,
    DensityRow,
    NfeRow,
    SampleRow,
    VariationRow,
)
from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.rows import read_rows, write_rows
from genpolicy.policies.evaluations import allowed_evaluations
from genpolicy.policies.fixtures import FixtureRow
from genpolicy.policies.policy import NetworkPolicy
from genpolicy.policies.validation_row import EARLIER_FOLDER
from genpolicy.tasks.api import Task, load_task


@dataclass(frozen=True)
class ReloadPlan:
    """What is reloaded and swept.

    Attributes:
        task: Registered name of the task.
        feasibility: Thresholds of the six layers.
        dataset: Folder of the dataset.
        audit: Folder of the audit.
        sweep: Samplers to try besides the chosen one, by method; a number is that many steps of
            the chosen one.
        samples: Candidates per situation.
        deployment: Horizons, deadline and candidates of an invocation.
        root_seed: Of the recorded moments that brought policies are asked about.
    """

    task: str
    feasibility: FeasibilitySettings
    dataset: Path
    audit: Path
    sweep: Sweep
    samples: int
    deployment: Deployment
    root_seed: int

    @property
    def horizons(self) -> HorizonConfig:
        """Common horizons."""
        return self.deployment.horizons


@dataclass
class ReloadRows:
    """Rows of the tables of `reload`."""

    samples: list[SampleRow] = field(default_factory=list)
    variations: list[VariationRow] = field(default_factory=list)
    compute: list[ComputeRow] = field(default_factory=list)
    nfe: list[NfeRow] = field(default_factory=list)
    coverage: list[CoverageRow] = field(default_factory=list)
    offline: list[OfflineRow] = field(default_factory=list)
    modes: list[ModeRow] = field(default_factory=list)
    earlier: list[ModeRow] = field(default_factory=list)
    density: list[DensityRow] = field(default_factory=list)
    answers: list[AnswerRow] = field(default_factory=list)
    conformance: dict[str, Conformance] = field(default_factory=dict)

    def take(self, name: str, answered: Answered) -> CandidateIdentity:
        """Add the rows of a policy that was brought; returns who it is."""
        self.samples += answered.samples
        self.variations += answered.variations
        self.nfe += answered.nfe
        self.modes += answered.modes
        self.coverage += answered.coverage
        self.answers += answered.answers
        self.conformance[name] = answered.conformance
        return answered.identity

    def write(self, folder: Path) -> None:
        """Write every table."""
        write_rows(folder / "samples.parquet", SampleRow, self.samples)
        write_rows(folder / "variations.parquet", VariationRow, self.variations)
        write_rows(folder / "compute.parquet", ComputeRow, self.compute)
        write_rows(folder / "nfe.parquet", NfeRow, self.nfe)
        write_rows(folder / "coverage.parquet", CoverageRow, self.coverage)
        write_rows(folder / "offline.parquet", OfflineRow, self.offline)
        write_rows(folder / "modes.parquet", ModeRow, self.modes)
        write_rows(folder / "modes_earlier.parquet", ModeRow, self.earlier)
        write_rows(folder / "density.parquet", DensityRow, self.density)
        write_rows(folder / "answers.parquet", AnswerRow, self.answers)
        CONFORMANCE.write(folder, self.conformance)


def write_reload(
    plan: ReloadPlan,
    candidates: Sequence[JudgedPolicy],
    fixtures: Path,
    folder: Path,
    *,
    brought: Sequence[BroughtPolicy] = (),
) -> None:
    """Reload every candidate in a fresh process, compare, sweep the NFE, write the evidence.

    Modes are counted again with the weights of three quarters of the training: what the last
    quarter changes, a longer training might go on changing.

    Args:
        plan: What is reloaded and swept.
        candidates: Every candidate and training seed.
        fixtures: The table of fixtures that training wrote.
        folder: Existing folder to write into.
        brought: Candidates that were not trained here.

    Raises:
        ContractError: Training left no fixture of a candidate.
    """
    data, task = load_dataset(plan.dataset), load_task(plan.task)
    checker = make_checker(task, plan.feasibility, action_period_s=plan.horizons.action_period_s)
    held_out = held_out_situations(plan.audit, data, horizons=plan.horizons)
    asked = Asked(data, task, checker, held_out, plan.samples, plan.deployment, plan.root_seed)
    written = read_rows(fixtures, FixtureRow)
    rows, identity = ReloadRows(), identities(candidates, data, plan.deployment)
    for candidate in candidates:
        before = [r for r in written if (r.method, r.seed) == (candidate.name, candidate.seed)]
        differing = _reloaded(plan, candidate, before, rows)
        rows.compute += compute_rows(candidate)
        policy = AnsweringPolicy(candidate.load())
        own = _measured(plan, candidate, policy, asked, rows)
        entry = identity[candidate.name]
        identity[candidate.name] = replace(
            entry,
            metadata_mismatches=entry.metadata_mismatches + differing,
            nonfinite_weights=entry.nonfinite_weights + nonfinite_weights(policy),
            nonfinite_chunks=entry.nonfinite_chunks + own.nonfinite,
            given_up=entry.given_up + own.given_up,
        )
    counts = Counter((row.method, row.seed) for row in written)
    rows.variations += in_fresh_process(
        trained_otherwise, candidates, plan.dataset, horizons=plan.horizons, counts=counts
    )
    answered = {other.name: ask_brought(other, asked) for other in brought}
    for name, answers in answered.items():
        identity[name] = rows.take(name, answers)
    rows.write(folder)
    if answered:
        FAULTS.write(folder, {name: answers.failed for name, answers in answered.items()})
    CANDIDATES.write(folder, identity)


def _measured(
    plan: ReloadPlan,
    candidate: JudgedPolicy,
    policy: NetworkPolicy,
    asked: Asked,
    rows: ReloadRows,
) -> Quality:
    """Errors, modes, sweep and densities of a candidate that came back.

    Returns:
        What its own sampler draws on held-out windows.
    """
    data, held_out, seed = asked.data, asked.held_out, candidate.seed
    task, checker = asked.task, asked.checker
    rows.offline += offline_rows(policy, data, seed=seed, horizons=plan.horizons)
    own, swept, quality = _sweep(
        plan, policy, held_out, seed, task=task, checker=checker, data=data
    )
    rows.modes += own
    rows.coverage += swept
    rows.earlier += modes_of_policy(
        AnsweringPolicy(loaded_on(candidate.device, candidate.folder / EARLIER_FOLDER)),
        held_out,
        seed=seed,
        convention=policy.sampler.name,
        samples=plan.samples,
        task=task,
        checker=checker,
    )
    rows.density += density_rows(
        policy, drawn_situations(held_out), data, seed=seed, samples=plan.samples
    )
    return quality


def nonfinite_weights(policy: NetworkPolicy) -> int:
    """Weights that are NaN or infinite."""
    state = policy.checkpoint.network.state_dict()
    return sum(int((~values.isfinite()).sum()) for values in state.values())


def _reloaded(
    plan: ReloadPlan, candidate: JudgedPolicy, before: Sequence[FixtureRow], rows: ReloadRows
) -> int:
    """Fixtures again, in fresh processes; returns how many metadata fields differ."""
    if not before:
        raise ContractError(
            where=f"fixtures of {candidate.name}, seed {candidate.seed}",
            found="none",
            expected="samples drawn at training",
            action="Train the generators again (`dvc repro train_generators`).",
        )
    compared, counted, differing = fixtures_again(
        candidate, before, plan.dataset, horizons=plan.horizons
    )
    rows.samples += compared
    allowed = allowed_evaluations(candidate.load().sampler)
    rows.nfe.append(
        NfeRow(
            method=candidate.name,
            seed=candidate.seed,
            recorded=before[0].nfe,
            counted=counted,
            expected=allowed.nearest(counted),
            least=allowed.least,
            most=allowed.most,
        )
    )
    return differing


def _sweep(
    plan: ReloadPlan,
    policy: NetworkPolicy,
    held_out: HeldOut,
    seed: int,
    *,
    task: Task,
    checker: FeasibilityChecker,
    data: Dataset,
) -> tuple[list[ModeRow], list[CoverageRow], Quality]:
    """Modes with the candidate's own sampler, coverage with this one and the swept ones.

    The last is what its own sampler draws on held-out windows.
    """
    own, its_own = list[ModeRow](), Quality(math.nan, math.nan, 0)
    rows, windows = [], swept_windows(data, plan.horizons)
    for sampler in swept_samplers(policy.sampler, plan.sweep.get(policy.method, ())):
        tried = AnsweringPolicy(sampling_by(policy, sampler))
        found = modes_of_policy(
            tried,
            held_out,
            seed=seed,
            convention=sampler.name,
            samples=plan.samples,
            task=task,
            checker=checker,
        )
        quality = quality_of(tried, windows, data)
        if sampler == policy.sampler:
            own, its_own = found, quality
        if found:
            rows.append(coverage_row(found, sampler=sampler, quality=quality))
    return own, rows, its_own
