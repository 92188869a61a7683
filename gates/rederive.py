"""Evidence derived again from what lies under it: what `genpolicy verify report` adds.

The independent checker reads every journal again, and every table that gates C and D judge must be
what the journals say. What is computed and not recorded (power, mutants) is computed again, and the
audit runs again on its dataset. Slow beside hashing, so it is asked for by name and not at every
admission.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from gates.card.searched import FAILURE_SEARCH
from gates.pages.printing import differing
from gates.proof import Rung
from gates.rederive_audit import rederive_audit
from gates.rederive_blocks import rederive_blocks
from gates.rederive_brought import rederive_brought
from gates.rederive_checked import rederive_checked
from gates.rederive_clocks import rederive_clocks
from gates.rederive_conformance import rederive_conformance
from gates.rederive_dataset import TRAININGS, rederive_dataset, rederive_trainings, trainings
from gates.rederive_distilled import rederive_costs, rederive_distilled
from gates.rederive_disturbance import rederive_disturbance, rederive_severities
from gates.rederive_draws import rederive_rollout_draws, rederive_shadow_draws
from gates.rederive_ingest import rederive_ingest
from gates.rederive_latency import rederive_latency
from gates.rederive_monitors import rederive_monitors
from gates.rederive_outcomes import rederive_outcomes
from gates.rederive_planner import rederive_planner
from gates.rederive_policies import rederive_policies
from gates.rederive_refused import rederive_refused
from gates.rederive_searched import rederive_searched
from gates.rederive_sessions import rederive_sessions
from gates.rederive_shadow import SHADOW, TaskSection, rederive_shadow
from gates.rederive_splices import rederive_splices
from gates.rederive_trainings import of_training, only_seed, seed_folders
from gates.report import Gate, read_report, report_path, stage_of
from gates.settings import PARAMS_FILE, read_params, section_of
from gates.stated import (
    Row,
    compare_keys,
    compare_rows,
    mapping,
    refuse,
    root_seed,
    section,
    training_seed,
)
from gates.stress.rollouts import FAULTS
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.errors import ConfigError, GenpolicyError, RefusedError
from genpolicy.evidence.documents.stress import ENVELOPE, POWER
from genpolicy.evidence.stress.envelope import envelope_document
from genpolicy.evidence.stress.perturbations import ReducedEnvelope
from genpolicy.evidence.stress.power import power_document
from genpolicy.evidence.stress.settings import ENVELOPE as CONDITION
from genpolicy.evidence.stress.settings import StressSettings
from genpolicy.execution.cell import Cell, ExecutionSettings
from genpolicy.execution.figures import expected_settings
from genpolicy.feasibility.cell import cell_of
from genpolicy.feasibility.figures import expected_motion
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.documents import read_json
from genpolicy.integrity.tables import read_table
from genpolicy.tasks.api import load_task
from genpolicy.verification.commands import reach_of
from genpolicy.verification.expected import ExpectedSettings
from genpolicy.verification.journal_source import readable
from genpolicy.verification.motion import ExpectedMotion
from genpolicy.verification.recoveries import KEYS as RECOVERY
from genpolicy.verification.refused import RefusedCandidates
from genpolicy.verification.rollouts import derived_with_recoveries
from genpolicy.verification.spliced import Spliced
from genpolicy.verification.tables import KEYS, derived_tables

STRESS = "artifacts/stress"
FOLDERS: dict[Gate, tuple[str, str]] = {
    "C": (SHADOW, "*.mcap"),
    "D": (STRESS, "journals/*.mcap"),
}
"""Evidence with journals: its folder, and where below it they lie."""
ROLLOUT = ("method", "perturbation", "start")


def rederived(root: Path, rungs: Sequence[Rung]) -> list[Rung]:
    """Proved rungs, those refused whose evidence is not what its journals say."""
    return [_rederived(root, rung) for rung in rungs]


def _rederived(root: Path, rung: Rung) -> Rung:
    if rung.verdict in ("REFUSED", "NOT JUDGED"):
        return rung
    try:
        rederive(root, rung.gate)
    except GenpolicyError as error:
        changes = {"verdict": "REFUSED", "decided_by": "", "note": str(error)}
        return replace(rung, **changes, exit_code=error.exit_code)  # type: ignore[arg-type]
    return rung


def rederive(root: Path, gate: Gate, *, printed: bool = True) -> None:
    """Hold the evidence of a gate against what lies under it: its journals, the rows of a dataset.

    What is printed of it is printed again behind that: `dvc commit` records an edited page as
    readily as the one that the gate printed.

    Args:
        root: Of the ladder.
        gate: Whose evidence.
        printed: Whether its page is asked as well.

    Raises:
        RefusedError: A row, the envelope or a finding of the checker is not what the journals say,
            a stated latency is not what the measured times give, a push or a drill not what was
            planned, recorded commands lead elsewhere than they are said to, a chunk, a mode, a
            fixture or a latent not what its checkpoint draws again, a row of the dataset not what
            its recordings give, one of the audit not what the dataset gives again, or a power, a
            mutant, a statistic, a split or the cost of a distillation is not what is computed
            again. Or a page or a file of rows says other than the report.
        IntegrityError: A journal or a table is missing or no regular file.
        BadInputError: A journal or a table cannot be read.
    """
    _evidence(root, gate)
    if printed:
        _printed(root, gate)


def _evidence(root: Path, gate: Gate) -> None:
    """Everything that lies under a report of the gate."""
    params = read_params(root)
    if gate == "A":
        rederive_dataset(root)
        rederive_ingest(root, params)
    if gate in TRAININGS:
        rederive_trainings(root, gate, params)
        if gate == "A":
            rederive_audit(root, params)  # modes are counted at the situations that it names
        rederive_policies(gate, root, params)
    if gate == "B":
        rederive_brought(root, params)
        rederive_conformance(root, params)
        rederive_costs(root, trainings(root, gate, params))
    if gate == "E" and (root / FAILURE_SEARCH).is_dir():
        rederive_searched(root, params, _held_to(params))
    if gate not in FOLDERS:
        return
    folder, pattern = FOLDERS[gate]
    journals = sorted((root / folder).glob(pattern))
    held_to = _held_to(params)
    rederive_checked(root, gate, folder, held_to, journals)
    rederive_sessions(root, gate, params, journals)
    if gate == "C":
        rederive_shadow(root, params)
        rederive_shadow_draws(root, params)
    else:
        rederive_planner(params)
        _tables(root, params, held_to[1], journals)
        rederive_clocks(root, params, held_to)
        rederive_monitors(root, params, held_to)
        rederive_latency(root, params, journals)
        rederive_disturbance(params, journals)
        rederive_severities(root, params)
        rederive_outcomes(params, journals)
        rederive_rollout_draws(root, params, journals)
        rederive_distilled(root, training_seed(params))
        _envelope(root, params)
        _power(root, params)
        _further_trainings(root, params, held_to)
        rederive_blocks(root, params, list(seed_folders(root, params).values()))


def _printed(root: Path, gate: Gate) -> None:
    """Pages and rows that lie there, recorded or not, byte by byte; one never printed is no lie."""
    if not (root / report_path(gate)).is_file():
        return
    if page := differing(root, read_report(root, gate)[0], whole=False):
        raise RefusedError(
            gate=gate,
            criterion=page,
            measured="another page",
            limit="the one that the report gives",
            report=report_path(gate),
            action=f"Run `dvc repro -f {stage_of(gate)}`; never edit a page.",
        )


def _held_to(params: Mapping[str, Any]) -> tuple[ExpectedSettings, ExpectedMotion]:
    """What every session must have declared, and what every executed row must have kept to."""
    horizons = section(params, "horizons", HorizonConfig)
    held_to = Cell(horizons, section(params, "execution", ExecutionSettings))
    feasibility = section(params, "feasibility", FeasibilitySettings)
    task = load_task(section(params, "task", TaskSection).name)
    cell = cell_of(task, feasibility, action_period_s=horizons.action_period_s)
    return expected_settings(held_to), expected_motion(cell, task.action_at, task.scene_poses)


def _further_trainings(
    root: Path, params: Mapping[str, Any], held_to: tuple[ExpectedSettings, ExpectedMotion]
) -> None:
    """What further training seeds gave: all that are planned, each held as the first one is.

    Only what no training has a part in is left to the first: planner, clocks, monitors, power.
    """
    for seed, folder in seed_folders(root, params).items():
        journals = sorted((root / folder).glob("journals/*.mcap"))
        with of_training(seed):
            own = only_seed(params, seed)
            rederive_checked(root, "D", folder, held_to, journals)
            rederive_sessions(root, "D", own, journals)
            _tables(root, own, held_to[1], journals, folder)
            rederive_latency(root, own, journals)
            rederive_disturbance(own, journals)
            rederive_outcomes(own, journals)
            rederive_rollout_draws(root, own, journals)
            rederive_distilled(root, seed, folder=folder)
            _envelope(root, own, folder)


def _tables(
    root: Path,
    params: Mapping[str, Any],
    motion: ExpectedMotion,
    journals: list[Path],
    folder: str = STRESS,
) -> None:
    """Every table that journals speak of: each row what they say, and none without the other."""
    seed = training_seed(params)
    with readable(f"{folder}/journals"):
        derived = [derived_with_recoveries(path) for path in journals]
        spliced = Spliced(motion.scene_path)
        refused = RefusedCandidates()
        tables = derived_tables(journals, spliced, refused)
    faults = f"{folder}/{Path(FAULTS).name}"
    stated_faults = read_table(root / faults).to_pylist() if (root / faults).is_file() else []
    _faults(params, faults, stated_faults, tables.pop(Path(FAULTS).stem))
    for name, keys, rows in (
        ("rollouts", ROLLOUT, [row for own, _ in derived for row in own.values()]),
        ("recoveries", RECOVERY, [row for _, own in derived for row in own]),
        *((name, KEYS[name], rows) for name, rows in tables.items()),
    ):
        path = f"{folder}/{name}.parquet"
        stated = read_table(root / path).to_pylist()
        compare_rows("D", path, keys, stated, rows, seed=seed)
    rederive_splices(root, params, spliced.rows, folder=folder)
    rollouts = [row for own, _ in derived for row in own.values()]
    rederive_refused(root, params, refused, rollouts, folder=folder)


def _faults(
    params: Mapping[str, Any], path: str, stated: Sequence[Row], derived: Sequence[Row]
) -> None:
    """`faults.parquet`: of policies in a process of their own, and of nobody else."""
    brought = mapping(section_of(params, "candidates"))
    for row in derived:
        if row["fault"] and row["method"] not in brought:
            named = f"fault {row['method']}/{row['perturbation']}/{row['fault']}"
            refuse("D", named, f"{row['count']} of a policy that runs here", "none of it")
    own = [row for row in derived if row["method"] in brought]
    compare_rows("D", path, KEYS[Path(FAULTS).stem], stated, own, seed=None)


def _envelope(root: Path, params: Mapping[str, Any], folder: str = STRESS) -> None:
    """`envelope.json`: the planned limits, and how far the commands of each journal went."""
    stress = section(params, "stress", StressSettings)
    planned = stress.perturbations.get(CONDITION)
    path = root / folder / ENVELOPE.file
    expected: dict[str, Any] = {}
    if isinstance(planned, ReducedEnvelope):
        journals = (root / folder / "journals").glob(f"*__{CONDITION}.mcap")
        reached = {journal.name.partition("__")[0]: reach_of(journal) for journal in journals}
        expected = ENVELOPE.plain(envelope_document(CONDITION, planned, reached))
    stated = mapping(read_json(path)) if path.is_file() else {}
    how = "as planned and as the journals say"
    compare_keys("D", f"{folder}/{ENVELOPE.file}", stated, expected, how)


def _power(root: Path, params: Mapping[str, Any]) -> None:
    """`power.json`: simulated again from margin, alpha, starts and seed of `params.yaml`."""
    path = f"{STRESS}/{POWER.file}"
    samplers = section_of(params, "train_generators").get("samplers")
    if not isinstance(samplers, dict):
        raise ConfigError(
            where=f"{PARAMS_FILE}: train_generators.samplers",
            found=f"a {type(samplers).__name__}",
            expected="a mapping",
            action="Restore the file from version control.",
        )
    stress = section(params, "stress", StressSettings)
    registered = len(samplers) + len(mapping(section_of(params, "candidates")))
    again = power_document(stress, candidates=registered, root_seed=root_seed(params))
    compare_keys(
        "D", path, mapping(read_json(root / path)), POWER.plain(again), "as simulated again"
    )
