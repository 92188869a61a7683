"""Which modes policies reach, measured again at a sample of situations.

That a table is bound by hash says that nobody changed it behind the report. Here its numbers are
held against the checkpoints that it speaks of: the same situations, the same names of the noise,
the same six layers. The situations are drawn by a hash of all tables of the folder
(`gates.sampled`). Who was brought is asked in a process of its own, as the stage did.
"""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

from gates.rederive_brought import brought_policy
from gates.rederive_conformance import REPEATS
from gates.rederive_shadow import TaskSection
from gates.report import Gate
from gates.reproducibility.settings import RELOAD
from gates.sampled import salt_of, some
from gates.stated import device_of, mapping, refuse, section
from genpolicy.candidates.answering import AnsweringPolicy
from genpolicy.candidates.judged import candidates_of, loaded_on, sampling_by
from genpolicy.candidates.wire.policy import running
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.settings import parse_settings
from genpolicy.data.dataset import Dataset, load_dataset
from genpolicy.errors import BadInputError, IntegrityError
from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.documents.conformance import CONFORMANCE
from genpolicy.evidence.need.held_out import HeldOut, held_out_situations, modes_of_policy
from genpolicy.evidence.reproducibility.brought import UNSAID
from genpolicy.evidence.rows.need import FactorModeRow, ModeRow
from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.rows import read_rows
from genpolicy.policies.policy import NetworkPolicy
from genpolicy.policies.protocol import Policy
from genpolicy.policies.settings import SamplerConfig
from genpolicy.policies.validation_row import EARLIER_FOLDER
from genpolicy.tasks.api import Task, load_task

AUDIT = "artifacts/audit"
DATASET = "artifacts/ingest"
OF_A_TABLE = 16
"""Situations at which every policy of a table is asked again."""
EXACT = ("samples", "modes_present")
COUNTED = (
    "modes_covered", "between_modes", "far_from_modes", "admissible", "valid", "modes_valid",
    "fewest_admissible",
)  # fmt: skip
ROUNDED_SHARE = 0.02
"""Of all samples of a policy that are asked again: how many another processor may put elsewhere.
It draws the same within 1e-5, and a sample so near to a limit falls on its other side."""

Row = ModeRow | FactorModeRow
Place = tuple[str, int]
"""Held-out episode and row."""
Group = tuple[str, int, str]
"""Method or variant, number of its training seed, and convention."""


@dataclass(frozen=True)
class Bench:
    """What everybody is asked with."""

    gate: Gate
    root: Path
    params: Mapping[str, Any]
    data: Dataset
    horizons: HorizonConfig
    task: Task
    checker: FeasibilityChecker

    @classmethod
    def of(cls, gate: Gate, root: Path, params: Mapping[str, Any]) -> "Bench":
        """What the settings of a ladder say of it."""
        horizons = section(params, "horizons", HorizonConfig)
        task = load_task(section(params, "task", TaskSection).name)
        feasibility = section(params, "feasibility", FeasibilitySettings)
        checker = make_checker(task, feasibility, action_period_s=horizons.action_period_s)
        return cls(gate, root, params, load_dataset(root / DATASET), horizons, task, checker)

    def number(self, name: str, key: str) -> int:
        """A whole number of a section."""
        return int(mapping(self.params.get(name)).get(key, 0))

    def held_out(self, seen: int) -> HeldOut:
        """Situations as a policy sees them that observes so many rows."""
        horizons = self.horizons.model_copy(update={"observation_horizon": seen})
        return held_out_situations(self.root / AUDIT, self.data, horizons=horizons)


def rederive_modes(bench: Bench) -> None:
    """Measure what the policies of gates A and B reach again, at a sample of the situations.

    Raises:
        RefusedError: A policy that is judged has no rows, a situation lacks or stands twice, or
            what a row counts is not what its checkpoint does there.
        ConfigError: A section of `params.yaml` cannot be read.
        IntegrityError: A file is missing, or is not what it claims to be.
        BadInputError: A table cannot be read.
    """
    if bench.gate == "A":
        samples = bench.number("measure_baselines", "samples")
        path = "artifacts/measure_baselines/modes.parquet"
        _hold(bench, path, ModeRow, _baselines(bench), lambda _: samples)
        few = bench.number("measure_factors", "samples")
        path = "artifacts/measure_factors/modes.parquet"
        _hold(bench, path, FactorModeRow, _variants(bench), lambda p: candidates_of(p, few))
    if bench.gate == "B":
        samples = bench.number("reload", "samples")
        path = "artifacts/reload/modes.parquet"
        _hold(bench, path, ModeRow, chain(_candidates(bench), _brought(bench)), lambda _: samples)
        path = "artifacts/reload/modes_earlier.parquet"
        _hold(bench, path, ModeRow, _candidates(bench, EARLIER_FOLDER), lambda _: samples)


def _hold(
    bench: Bench,
    path: str,
    model: type[Row],
    policies: Iterator[tuple[Group, Policy | None]],
    samples_of: Callable[[Policy], int],
) -> None:
    """Hold a table against everybody who has to stand in it; of None only that it does."""
    table = bench.root / path
    stated = _by_group(bench.gate, read_rows(table, model))
    by_horizon: dict[int, tuple[HeldOut, HeldOut]] = {}
    for group, policy in policies:
        own = stated.pop(group, {})
        seen = (policy or bench).horizons.observation_horizon
        if seen not in by_horizon:
            whole = bench.held_out(seen)
            by_horizon[seen] = whole, _some_of(whole, table)
        held_out, asked = by_horizon[seen]
        everywhere = {(s.episode_uuid, s.index) for s in held_out.situations}
        for place in sorted(everywhere ^ own.keys()):
            found = "no row" if place in everywhere else "a row"
            wanted = f"one row of {path} for each situation that the audit names"
            refuse(bench.gate, _of(group, place), found, wanted)
        if policy is None:
            continue
        again = modes_of_policy(
            policy, asked, seed=group[1], convention=group[2],
            samples=samples_of(policy), task=bench.task, checker=bench.checker,
        )  # fmt: skip
        _compare(bench.gate, group, own, again)
    for group in sorted(stated):
        refuse(bench.gate, _of(group), f"rows of {path}", "none: nobody of that name is judged")


def _by_group(gate: Gate, rows: Sequence[Row]) -> dict[Group, dict[Place, Row]]:
    found: dict[Group, dict[Place, Row]] = defaultdict(dict)
    for row in rows:
        name = row.variant if isinstance(row, FactorModeRow) else row.method
        group, place = (name, row.seed, row.convention), (row.episode_uuid, row.index)
        if place in found[group]:
            refuse(gate, _of(group, place), "stated twice", "one row")
        found[group][place] = row
    return dict(found)


def _baselines(bench: Bench) -> Iterator[tuple[Group, NetworkPolicy]]:
    for method in mapping(mapping(bench.params.get("train_baselines")).get("samplers")):
        for seed, own in trained_in(bench, "train_baselines", method):
            yield from _by_each(bench, method, seed, own)


def _variants(bench: Bench) -> Iterator[tuple[Group, NetworkPolicy]]:
    for variant in mapping(mapping(bench.params.get("train_factors")).get("variants")):
        for seed, own in trained_in(bench, "train_factors", variant):
            yield from _by_each(bench, variant, seed, own)


def _candidates(bench: Bench, part: str = "") -> Iterator[tuple[Group, NetworkPolicy]]:
    """Who was trained, by the weights of a part of the training."""
    for method in mapping(mapping(bench.params.get("train_generators")).get("samplers")):
        for seed, own in trained_in(bench, "train_generators", method, part):
            yield (method, seed, own.sampler.name), own


def _brought(bench: Bench) -> Iterator[tuple[Group, Policy | None]]:
    """Who was brought, one process after the other.

    Who answers otherwise when asked again fails for that, and nothing of it can be asked again.
    """
    found = CONFORMANCE.read(bench.root / RELOAD)
    scene, contract = bench.task.scene_path, bench.data.observation_contract
    for name in mapping(bench.params.get("candidates")):
        own = brought_policy(bench.root, bench.params, str(name))
        assert own is not None  # it is one of the section
        declared = own.entry.declared
        group = own.name, own.seed, declared.sampler if declared else UNSAID
        told = found[own.name].findings if own.name in found else ()
        if any(one.judged == "fails" for one in told if one.name in REPEATS):
            yield group, None
            continue
        with running(own, contract, scene=scene) as policy:
            yield group, policy


def trained_in(
    bench: Bench, stage: str, name: str, part: str = ""
) -> Iterator[tuple[int, NetworkPolicy]]:
    """Checkpoints of a name, by the number of their training seed; what they give up is NaN."""
    device, seeds = device_of(bench.params), mapping(bench.params.get("policy")).get("seeds")
    for seed in seeds if isinstance(seeds, list) else ():
        place = f"artifacts/{stage}/{name}/seed_{seed}"
        try:
            own = AnsweringPolicy(loaded_on(device, bench.root / place / part))
        except (BadInputError, IntegrityError) as error:
            refuse(bench.gate, place, str(error), "the checkpoint that was measured")
        yield int(seed), own


def _by_each(
    bench: Bench, name: str, seed: int, own: NetworkPolicy
) -> Iterator[tuple[Group, NetworkPolicy]]:
    """A checkpoint under its own sampler, and under each further one it is measured with."""
    stated = mapping(mapping(bench.params.get("measure_baselines")).get("conventions"))
    samplers: dict[str, SamplerConfig] = {own.sampler.name: own.sampler}
    for convention, sampler in mapping(stated.get(own.method)).items():
        where = f"measure_baselines.conventions.{own.method}.{convention}"
        samplers[convention] = parse_settings(SamplerConfig, sampler, where=where)
    for convention, config in samplers.items():
        yield (name, seed, convention), AnsweringPolicy(sampling_by(own, config))


def _some_of(held_out: HeldOut, table: Path) -> HeldOut:
    """At most so many of the situations, by a hash of all tables of the folder, in their order."""
    salt = salt_of(table.parent.glob("*.parquet"))
    chosen = some(range(len(held_out.situations)), OF_A_TABLE, name=table.name, salt=salt)
    situations = tuple(held_out.situations[i] for i in chosen)
    return HeldOut(situations, held_out.observations[chosen])


def _compare(
    gate: Gate, group: Group, stated: Mapping[Place, Row], again: Sequence[ModeRow]
) -> None:
    """Each row within a sample of what is found again, and all of a policy together nearly so.

    Of evaluations it may state more: a solver that chooses its steps counts the most of a call.
    """
    elsewhere = 0
    for row in again:
        place = (row.episode_uuid, row.index)
        for column in (*EXACT, *COUNTED):
            told, found = getattr(stated[place], column), getattr(row, column)
            if abs(told - found) > (column in COUNTED):
                expected = f"{found!r}, as its checkpoint does there"
                refuse(gate, f"{_of(group, place)}: {column}", repr(told), expected)
            elsewhere += abs(told - found)
        if stated[place].nfe < row.nfe:
            expected = f"{row.nfe} or more, as its checkpoint asks there"
            refuse(gate, f"{_of(group, place)}: nfe", str(stated[place].nfe), expected)
    bound = max(1.0, ROUNDED_SHARE * sum(row.samples for row in again))
    if elsewhere > bound:
        found = f"{elsewhere} counts otherwise at {len(again)} situations"
        refuse(gate, f"{_of(group)}: modes", found, f"at most {bound:.3g}, what rounding explains")


def _of(group: Group, place: Place | None = None) -> str:
    name, seed, convention = group
    where = "" if place is None else f" at {place[0]}, row {place[1]}"
    return f"{name} (seed {seed}) by {convention}{where}"
