"""Journals are a second witness: what they do not say is refused, whoever recorded it."""

import json
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml
from makers import maker, write_policy

from gates import rederive as module
from gates.proof import Rung
from gates.rederive import STRESS, rederive, rederived
from gates.rederive_disturbance import rederive_severities
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.latency import MEASURED_TERMS, Term
from genpolicy.errors import BadInputError, ConfigError, IntegrityError, RefusedError
from genpolicy.evidence.documents import shadow, stress
from genpolicy.evidence.rows.reproducibility import LatencyRow
from genpolicy.evidence.rows.stress import (
    SEVERITIES,
    AgeRow,
    ConservationRow,
    FaultRow,
    InvocationRow,
    OverrunRow,
    RecoveryRow,
    RefusedRow,
    RolloutRow,
    SeverityRow,
    SpliceRow,
    StressCountRow,
    StressStubRow,
)
from genpolicy.evidence.shadow.tables import checked
from genpolicy.evidence.stress.measured import Measured
from genpolicy.evidence.stress.power import power_document
from genpolicy.evidence.stress.settings import StressSettings
from genpolicy.execution.cell import Cell, ExecutionSettings
from genpolicy.execution.executor import Executor
from genpolicy.execution.journal import Journal, write_journal
from genpolicy.execution.recovery import Recovery
from genpolicy.execution.stub import ControllerStub
from genpolicy.execution.supervisor import Supervisor
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.rows import write_rows
from genpolicy.integrity.tables import read_table, write_table
from genpolicy.seeds import stream
from genpolicy.tasks.api import World, WorldSettings, load_task
from genpolicy.verification.checker import check_journal
from genpolicy.verification.commands import reach_of
from genpolicy.verification.rollouts import derived_with_recoveries
from genpolicy.verification.tables import derived_tables

PARAMS = yaml.safe_load((Path(__file__).parents[2] / "params.yaml").read_text())
DECLARED = PARAMS["latency"]["declared"]
DECLARED |= {term: [0.001, 0.001] for term in DECLARED}
LATENCY = [
    LatencyRow(method, 1, 1, str(term), "model", how, 1, seconds, "measured", None)
    for method in ("flow", "bc")
    for how, seconds in (("cold", 0.005), ("warm", 0.002))
    for term in MEASURED_TERMS
]
SENSED_S, FIRST_S = 0.004, 0.031
TERMS = {f"{term}_s": 0.002 if term in MEASURED_TERMS else 0.001 for term in Term}
TERMS["sample_s"] += 0.015
"""Six declared terms, five measured ones, and the five of a cold call 3 ms longer each."""
NAMES = ("flow__nominal", "bc__nominal", "flow__envelope")
POWER = canonical_json(
    stress.POWER.plain(power_document(
        StressSettings(**PARAMS["stress"]),
        candidates=len(PARAMS["train_generators"]["samplers"]),
        root_seed=PARAMS["seed"],
    ))
)  # fmt: skip
TABLES = {
    "invocations": InvocationRow, "counts": StressCountRow, "conservation": ConservationRow,
    "stub": StressStubRow, "ages": AgeRow, "overruns": OverrunRow, "recoveries": RecoveryRow,
}  # fmt: skip


@cache
def _world(start: int) -> World:
    """The world of a rollout of the plan."""
    task = load_task("tabletop_insertion")
    state = task.sample_start(stream(PARAMS["seed"], "starts", start))
    return task.make_world(state, settings=WorldSettings(task.calibration_epochs[-1]))


def _session(name: str, start: int, fault: str = "") -> Journal:
    """A rollout in which nothing is delivered: it holds, touches something and ends."""
    method, _, perturbation = name.partition("__")
    labels = {
        "method": method, "perturbation": perturbation, "start": str(start), "start_sha256": "ab",
    }  # fmt: skip
    journal = Journal(f"{method}/{perturbation}/{start}", labels)
    horizons = HorizonConfig(**PARAMS["horizons"])
    execution = ExecutionSettings(**PARAMS["execution"])
    cell = Cell(horizons, execution)
    supervisor = Supervisor(execution, journal)
    executor = Executor(cell, journal, ControllerStub(cell, journal, supervisor))
    executor.set_active(0.0, *maker(method))
    task, world = load_task("tabletop_insertion"), _world(start)
    seen, measured = world.observe(), Measured(task, world, journal)
    executor.controller(0.0, cell.controller_mode)
    for tick in range(4):
        now_s = tick * horizons.action_period_s
        measured.note(now_s)
        executor.see(now_s, task.scene_poses(seen))
        journal.exposure(now_s, seen)
        place_m, _ = world.tcp_pose
        executor.observe(now_s, now_s, "approach", "epoch_1", 0.0, tcp_m=place_m)
        executor.tick(now_s)
        journal.arrived(now_s + SENSED_S, exposed_s=now_s)
    executor.begin_invocation(0.2, "one", repr(FIRST_S))
    journal.add("latency", journal.clock(0.2), {"id": "one", **TERMS})
    key = ["stress", perturbation, start, 1]
    history = np.stack([seen, seen])
    journal.conditioning(0.2, invocation_id="one", exposed_s=now_s, key=key, history=history)
    if fault:
        journal.invocation(0.2, invocation_id="one", stage="fault", detail=fault)
    executor.end_invocation(0.2, "one", "overrun")  # of a term: its deadline is not over
    if (method, start) == ("bc", 1):
        recovery = Recovery(execution, journal)
        recovery.trigger(0.2, "approach", "silence")
        recovery.feel(0.2, 1.5)
    for force_n in (3.0, 7.5, 2.0):
        journal.add("force", journal.clock(0.2), {"force_n": force_n})
    told = journal.last("state")
    journal.add("state", journal.clock(0.2), {**told, "force_n": 7.5})
    outcome = "collision" if start == 0 else "timeout"
    supervisor.observe_collision(0.2, start == 0)
    journal.add("outcome", journal.clock(0.2), {"outcome": outcome, "mode": "left"})
    executor.end_episode(0.2)
    return journal


@pytest.fixture
def root(tmp_path, monkeypatch):
    """Stress evidence of two methods on two starts, as its journals tell it.

    No world made it: what recorded commands lead to is asked in `test_rederive_outcomes`.
    """
    monkeypatch.setattr(module, "rederive_outcomes", lambda *given: None)
    (tmp_path / "params.yaml").write_text(yaml.safe_dump(PARAMS))
    (tmp_path / "artifacts" / "latency").mkdir(parents=True)
    write_rows(tmp_path / "artifacts" / "latency" / "latency.parquet", LatencyRow, LATENCY)
    for method in ("flow", "bc"):
        write_policy(tmp_path, method)
    folder = tmp_path / STRESS
    (folder / "journals").mkdir(parents=True)
    expected, _ = module._held_to(PARAMS)
    rows, recoveries, documents = [], [], {}
    for name in NAMES:
        path = folder / "journals" / f"{name}.mcap"
        write_journal(path, [_session(name, start) for start in (0, 1)])
        documents[path.name] = check_journal(path, expected).as_document()
        derived, entered = derived_with_recoveries(path)
        rows += [RolloutRow(**columns, seed=0) for columns in derived.values()]
        recoveries += [RecoveryRow(**columns, seed=0) for columns in entered]
    write_rows(folder / "rollouts.parquet", RolloutRow, rows)
    write_rows(folder / "recoveries.parquet", RecoveryRow, recoveries)
    for name, listed in derived_tables(sorted((folder / "journals").iterdir())).items():
        if name == "faults":  # nobody was brought
            continue
        seed = {"seed": 0} if name == "invocations" else {}
        made = [TABLES[name](**row, **seed) for row in listed]
        write_rows(folder / f"{name}.parquet", TABLES[name], made)
    write_rows(folder / "splices.parquet", SpliceRow, [])  # nothing is delivered
    write_rows(folder / "refused.parquet", RefusedRow, [])
    shadow.CHECKER.write(folder, checked(documents))
    (folder / "envelope.json").write_text(json.dumps(_envelope(folder)))
    (folder / "power.json").write_bytes(POWER)
    return tmp_path


def _envelope(folder):
    planned = {k: v for k, v in PARAMS["stress"]["perturbations"]["envelope"].items()
               if k != "kind"}  # fmt: skip
    reach = asdict(reach_of(folder / "journals" / "flow__envelope.mcap").as_document())
    return {"condition": "envelope", **planned, "reached": {"flow": reach}}


def test_true_evidence_stands(root):
    rederive(root, "D")
    rederive(root, "E")
    (row, *_) = read_table(root / STRESS / "rollouts.parquet").to_pylist()
    assert (row["force_peak_n"], row["outcome"], row["ticks"]) == (7.5, "collision", 4)
    assert (row["invocations"], row["deadline_misses"]) == (1, 1)
    assert row["latency_p95_s"] == FIRST_S


def test_the_commands_of_every_journal_are_played_again(root, monkeypatch):
    asked = []
    monkeypatch.setattr(module, "rederive_outcomes", lambda *given: asked.append(given))
    rederive(root, "D")
    journals = sorted((root / STRESS / "journals").glob("*.mcap"))
    assert asked == [(yaml.safe_load((root / "params.yaml").read_text()), journals)]
    assert len(journals) == len(NAMES)


def test_a_term_that_was_not_drawn_is_refused_where_the_sum_is_the_same(root, monkeypatch):
    for term, more_s in (("encode_s", 0.001), ("sample_s", -0.001)):
        monkeypatch.setitem(TERMS, term, TERMS[term] + more_s)
    path = root / STRESS / "journals" / "flow__nominal.mcap"
    write_journal(path, [_session("flow__nominal", start) for start in (0, 1)])
    assert check_journal(path).violations == []
    with pytest.raises(RefusedError, match="encode of invocation 'one'"):
        rederive(root, "D")


FORGED = {
    "success": True, "outcome": "success", "force_peak_n": 1.0, "deadline_misses": 0,
    "interventions": 5, "latency_p95_s": 0.001, "start_sha256": "cd", "mode": "right",
    "recovered": True, "rejections": 9, "hold_ticks": 1, "action_age_p95_s": 0.1, "seed": 7,
    "duration_s": 0.1,
}  # fmt: skip


@pytest.mark.parametrize("column", FORGED)
def test_a_forged_cell_is_refused_by_name(root, column):
    path = root / STRESS / "rollouts.parquet"
    table = read_table(path)
    place = table.schema.get_field_index(column)
    values = [FORGED[column], *table[column].to_pylist()[1:]]
    write_table(path, table.set_column(place, table.schema.field(place), [values]))
    with pytest.raises(RefusedError, match=rf"rollout flow/nominal/0: {column} is") as caught:
        rederive(root, "D")
    assert "as its journal says" in str(caught.value)


def test_a_row_without_a_journal_and_a_journal_without_a_row(root):
    path = root / STRESS / "rollouts.parquet"
    table = read_table(path)
    write_table(path, table.slice(1))
    with pytest.raises(RefusedError, match=r"rollout flow/nominal/0 is only in a journal"):
        rederive(root, "D")
    rows = table.to_pylist()
    extra = RolloutRow(**{**rows[0], "start": 7})
    write_rows(path, RolloutRow, [*(RolloutRow(**row) for row in rows), extra])
    with pytest.raises(RefusedError, match=r"rollout flow/nominal/7 is without a journal"):
        rederive(root, "D")
    assert asdict(extra)["start"] == 7


def test_a_finding_of_the_checker_that_was_removed_is_found_again(root):
    """A session that declares other limits than `params.yaml` is a violation."""
    params = yaml.safe_load((root / "params.yaml").read_text())
    params["execution"]["queue_capacity"] += 1
    (root / "params.yaml").write_text(yaml.safe_dump(params))
    with pytest.raises(RefusedError, match=r"0 violations in 0 actions.*required 2 violations"):
        rederive(root, "D")


def test_a_violation_left_out_of_the_list_is_found(root):
    path = root / STRESS / "checker.json"
    document = json.loads(path.read_text())
    document["violations"] = [
        {"journal": "a", "session": "s", "event": 1, "rule": "P1", "text": "."}
    ]
    path.write_text(json.dumps(document))
    with pytest.raises(RefusedError, match=r"checker\.json: violations"):
        rederive(root, "D")


@pytest.mark.parametrize("key", ["checked_actions", "reproved_actions"])
def test_actions_that_nobody_checked_are_found(root, key):
    path = root / STRESS / "checker.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {key: 5}))
    with pytest.raises(RefusedError, match=rf"checker\.json: {key} is 5, required 0"):
        rederive(root, "D")


FORGED_TABLES = {
    "invocations": ("latency_s", 0.001, "invocation bc/nominal/0/0: latency_s"),
    "counts": ("count", 3, "count bc/nominal/: count"),
    "conservation": ("generated", 9, "conservation bc/nominal: generated"),
    "stub": ("stale", 1, "stub bc/nominal: stale"),
    "overruns": ("count", 2, "overrun bc/nominal//: count"),
    "recoveries": ("recovered", True, "recovery bc/nominal/1/0: recovered"),
}


def test_a_splice_that_is_in_no_journal_is_refused(root):
    made = SpliceRow("flow", 0, "nominal", 0, "replace", 0, 0, 0.1, None, 0.1, None)
    write_rows(root / STRESS / "splices.parquet", SpliceRow, [made])
    with pytest.raises(RefusedError, match=r"splice flow/nominal/0/0 is without a journal"):
        rederive(root, "D")


@pytest.mark.parametrize("name", FORGED_TABLES)
def test_a_forged_cell_of_every_other_table_is_refused_by_name(root, name):
    column, value, said = FORGED_TABLES[name]
    path = root / STRESS / f"{name}.parquet"
    rows = read_table(path).to_pylist()
    write_rows(path, TABLES[name], [TABLES[name](**{**rows[0], column: value}),
                                    *(TABLES[name](**row) for row in rows[1:])])  # fmt: skip
    with pytest.raises(RefusedError, match=rf"{said} is {value}.*as its journal says"):
        rederive(root, "D")
    write_rows(path, TABLES[name], [TABLES[name](**row) for row in rows[1:]])
    with pytest.raises(RefusedError, match="is only in a journal"):
        rederive(root, "D")
    write_rows(path, TABLES[name], [TABLES[name](**row) for row in (*rows, rows[0])])
    with pytest.raises(RefusedError, match="is stated twice"):
        rederive(root, "D")


def _failing(root, *, brought):
    """The first rollout of `flow` misses its deadline because its process failed."""
    name = "flow__nominal"
    path = root / STRESS / "journals" / f"{name}.mcap"
    write_journal(path, [_session(name, 0, "late"), _session(name, 1)])
    expected, _ = module._held_to(PARAMS)
    reports = {
        p.name: check_journal(p, expected).as_document()
        for p in sorted((root / STRESS / "journals").iterdir())
    }
    shadow.CHECKER.write(root / STRESS, checked(reports))
    section = {"flow": "own/flow.yaml"} if brought else {}
    return {**PARAMS, "candidates": section}, sorted((root / STRESS / "journals").iterdir())


def test_a_fault_of_a_policy_that_runs_here_is_refused(root):
    params, journals = _failing(root, brought=False)
    with pytest.raises(RefusedError, match=r"fault flow/nominal/late.*1 of a policy that runs"):
        module._tables(root, params, module._held_to(PARAMS)[1], journals)


def test_faults_are_what_journals_say_of_those_that_were_brought(root):
    params, journals = _failing(root, brought=True)
    path = root / STRESS / "faults.parquet"
    rows = [FaultRow("flow", "envelope", "", 0), FaultRow("flow", "nominal", "late", 1)]

    def held():
        module._tables(root, params, module._held_to(PARAMS)[1], journals)

    write_rows(path, FaultRow, rows)
    held()
    write_rows(path, FaultRow, [rows[0], replace(rows[1], count=0)])
    with pytest.raises(RefusedError, match=r"fault flow/nominal/late: count is 0"):
        held()
    write_rows(path, FaultRow, [rows[0], replace(rows[1], fault="shape")])
    with pytest.raises(RefusedError, match=r"fault flow/nominal/late is only in a journal"):
        held()
    path.unlink()
    with pytest.raises(RefusedError, match=r"fault flow/envelope/ is only in a journal"):
        held()


def test_ages_of_actions_that_no_journal_has_are_refused(root):
    made = AgeRow("flow", "nominal", 0.95, 0.1, 40)
    write_rows(root / STRESS / "ages.parquet", AgeRow, [made])
    with pytest.raises(RefusedError, match=r"age flow/nominal/0\.95 is without a journal"):
        rederive(root, "D")


@pytest.mark.parametrize(("key", "value"), [
    ("speed_limit_m_s", 0.5), ("workspace_lower_m", [0.0, 0.0, 0.0]), ("condition", "nominal"),
    ("reached", {"flow": {"commands": 900, "fastest_m_s": 0.1, "lowest_m": None,
                          "highest_m": None}}),
])  # fmt: skip
def test_an_envelope_that_was_not_planned_or_not_run_is_refused(root, key, value):
    path = root / STRESS / "envelope.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {key: value}))
    with pytest.raises(RefusedError, match=rf"envelope\.json: {key} is .*as planned"):
        rederive(root, "D")
    path.unlink()
    with pytest.raises(RefusedError, match=r"envelope\.json: condition is None"):
        rederive(root, "D")


def test_a_distillation_that_no_candidate_has_is_refused(root):
    said = {"teacher": "diffusion", "teacher_sha256": "0", "updates": 1}
    (root / STRESS / stress.DISTILLED.file).write_text(json.dumps({"flow": said}))
    with pytest.raises(RefusedError, match=r"distilled\.json: flow"):
        rederive(root, "D")


def test_a_journal_that_nobody_checked_is_found(root):
    path = root / STRESS / "checker.json"
    document = json.loads(path.read_text())
    del document["journals"]["flow__nominal.mcap"]
    path.write_text(json.dumps(document))
    with pytest.raises(RefusedError, match=r"flow__nominal\.mcap is nothing"):
        rederive(root, "D")


def test_a_damaged_journal_is_bad_input(root):
    (root / STRESS / "journals" / "flow__nominal.mcap").write_bytes(b"journal")
    with pytest.raises(BadInputError, match="no journal"):
        rederive(root, "D")


def test_a_refused_rung_says_why_and_the_others_stand(root):
    (root / STRESS / "journals" / "bc__nominal.mcap").unlink()
    rungs = [Rung(gate, "n", "PASS", "", "", "r", 0) for gate in "ED"]
    first, second = rederived(root, rungs)
    assert first == rungs[0]
    assert (second.verdict, second.exit_code) == ("REFUSED", 3)
    assert "bc__nominal.mcap" in second.note
    judged = Rung("D", "n", "REFUSED", "", "before", "r", 2)
    assert rederived(root, [judged]) == [judged]


@pytest.mark.parametrize("total", ["checked_actions", "reproved_actions"])
def test_a_total_that_the_gates_judge_by_is_derived_again(root, total):
    path = root / STRESS / "checker.json"
    document = json.loads(path.read_text())
    document[total] += 1000
    path.write_text(json.dumps(document))
    with pytest.raises(RefusedError, match=rf"checker\.json: {total} is 1\d\d\d, required \d+"):
        rederive(root, "D")


def _stronger(document):
    document["rows"][3]["promote_share"] = 0.99


def _fewer_worlds(document):
    document["rows"].pop()


@pytest.mark.parametrize(("key", "forge"), [
    ("rows", _stronger), ("rows", _fewer_worlds),
    ("alpha", lambda document: document.update(alpha=0.2)),
    ("pairs", lambda document: document.pop("pairs")),
    ("margin", lambda document: document.update(margin=0.0)),
    ("more", lambda document: document.update(more=1)),
])  # fmt: skip
def test_a_power_that_no_simulation_gives_is_refused(root, key, forge):
    path = root / STRESS / "power.json"
    document = json.loads(path.read_text())
    forge(document)
    path.write_text(json.dumps(document))
    with pytest.raises(RefusedError, match=rf"power\.json: {key} is .*as simulated again"):
        rederive(root, "D")


def test_power_is_that_of_the_registered_candidates_and_seed(root):
    params = yaml.safe_load((root / "params.yaml").read_text())
    params["train_generators"]["samplers"].pop("flow")
    (root / "params.yaml").write_text(yaml.safe_dump(params))
    with pytest.raises(RefusedError, match=r"power\.json: alpha is"):
        rederive(root, "D")
    params["train_generators"]["samplers"] = ["flow"]
    (root / "params.yaml").write_text(yaml.safe_dump(params))
    with pytest.raises(ConfigError, match=r"samplers is a list, expected a mapping"):
        rederive(root, "D")


def test_a_clock_that_was_faster_on_paper_is_refused(root):
    """The journals and every table agree: only the measured times speak against them."""
    path = root / "artifacts" / "latency" / "latency.parquet"
    slower = [replace(row, seconds=1.01 * row.seconds) for row in LATENCY]
    write_rows(path, LatencyRow, slower)
    said = r"bc__nominal\.mcap is invocation 'one' states 0\.031 s, 0\.03125 s by the measured"
    with pytest.raises(RefusedError, match=said):
        rederive(root, "D")
    write_rows(path, LatencyRow, [row for row in LATENCY if row.method == "flow"])
    with pytest.raises(RefusedError, match="nan s by the measured times"):
        rederive(root, "D")
    path.unlink()
    with pytest.raises(IntegrityError, match="latency"):
        rederive(root, "D")


def test_a_rollout_that_was_not_pushed_as_planned_is_refused(root, monkeypatch):
    said = iter(["'bc/nominal/0' was pushed never"])
    monkeypatch.setattr("gates.rederive_disturbance.disturbed_otherwise", lambda path, plan: said)
    with pytest.raises(RefusedError, match=r"bc__nominal\.mcap is 'bc/nominal/0' was pushed never"):
        rederive(root, "D")


def test_sizes_that_nobody_planned_are_refused(root):
    """Of a curve that is shown; what is planned and not written is refused as well."""
    path = root / STRESS / SEVERITIES
    rows = [
        SeverityRow("camera_delay@0.04", "camera_delay", "magnitude_s", 0.04),
        SeverityRow("camera_delay", "camera_delay", "magnitude_s", 0.08),
    ]
    planned = {"camera_delay": {"field": "magnitude_s", "values": [0.04, 0.08]}}
    params = PARAMS | {"stress": PARAMS["stress"] | {"severities": planned}}
    rederive_severities(root, PARAMS)
    with pytest.raises(RefusedError, match=r"severities\.parquet is 0 sizes"):
        rederive_severities(root, params)
    write_rows(path, SeverityRow, rows)
    rederive_severities(root, params)
    with pytest.raises(RefusedError, match=r"severities\.parquet is 2 sizes"):
        rederive_severities(root, PARAMS)
    write_rows(path, SeverityRow, [replace(rows[0], severity=0.05), rows[1]])
    with pytest.raises(RefusedError, match="params"):
        rederive_severities(root, params)


def test_an_invocation_that_does_not_say_from_what_it_drew_is_refused(root, monkeypatch):
    monkeypatch.setattr(Journal, "conditioning", lambda *_, **__: None)
    path = root / STRESS / "journals" / "flow__nominal.mcap"
    write_journal(path, [_session("flow__nominal", start) for start in (0, 1)])
    document = json.loads((root / STRESS / "checker.json").read_text())
    again = check_journal(path, module._held_to(PARAMS)[0]).as_document()
    told = {
        name: shadow.CHECKER.read(root / STRESS).journals[name] for name in document["journals"]
    }
    shadow.CHECKER.write(root / STRESS, checked(told | {path.name: again}))
    with pytest.raises(RefusedError, match=r"nominal\.mcap is 'one' begins, and nobody says"):
        rederive(root, "D")


def test_declared_times_and_planned_perturbations_are_held_too(root, monkeypatch):
    monkeypatch.setattr("genpolicy.evidence.stress.settings.OF_THEIR_NAME", ())
    for section, key, value in (
        ("latency", "declared", DECLARED | {"network": [0.002, 0.002]}),
        ("stress", "perturbations", PARAMS["stress"]["perturbations"]
         | {"nominal": {"kind": "camera_delay", "probability": 1.0, "magnitude_s": 0.08}}),
    ):  # fmt: skip
        params = PARAMS | {section: PARAMS[section] | {key: value}}
        (root / "params.yaml").write_text(yaml.safe_dump(params))
        with pytest.raises(RefusedError, match=r"states 0\.031 s"):
            rederive(root, "D")
