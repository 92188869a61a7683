"""Rows of the audit that its dataset does not give are refused by name, whichever they are."""

import copy
import json
import shutil
from dataclasses import asdict

import evidence
import pyarrow as pa
import pytest

from gates import rederive
from gates.proof import Rung
from gates.rederive_audit import GROWN_COUNT, KEYS, difference, hold_audit, rederive_audit
from genpolicy.audit.documents import PERSISTENCE, SUMMARY
from genpolicy.audit.evidence import write_evidence
from genpolicy.audit.reach_rows import FURTHER_TABLES, FindingDraw, Reach
from genpolicy.audit.rows import TABLES, Finding, SupportPoint
from genpolicy.audit.settings import AuditSettings
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.errors import ConfigError, RefusedError
from genpolicy.evidence.need.audit_task import audit_task, round_obstacles, settings_of
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.tables import read_table, write_table

FINDING = Finding("clock", "robot", "epoch e1", "clock_residual_s", 0.08, 0.01, "s", "Align.")
MODEL = TABLES | FURTHER_TABLES


@pytest.fixture
def folders(_evidence, tmp_path):
    """What is stated, and the same as measured again; of every kind of row there are some."""
    stated, again = tmp_path / "artifacts/audit", tmp_path / "again"
    shutil.copytree(_evidence / "artifacts/audit", stated)
    draw = FindingDraw(draw=0, **asdict(FINDING))
    evidence.table(tmp_path, "audit/findings.parquet", Finding, [asdict(FINDING)])
    evidence.table(tmp_path, "audit/finding_draws.parquet", FindingDraw, [asdict(draw)])
    reach = [asdict(Reach(kind, 1, 40, 36)) for kind in ("local", "learned")]
    evidence.table(tmp_path, "audit/reach.parquet", Reach, reach)
    point = SupportPoint("approach", "e1", 4, True, True, (0.4, 0.1, 0.2))
    evidence.table(tmp_path, "audit/support.parquet", SupportPoint, [asdict(point)])
    evidence.document(
        tmp_path, "audit/settings.json", {"radius": 6.0, "ignored_channels": ["phase"]}
    )
    shutil.copytree(stated, again)
    (again / "scene.png").unlink()
    return stated, again


def edit(folder, name, change):
    """Change the rows of a table; its schema stays."""
    path = folder / f"{name}.parquet"
    table = read_table(path)
    rows = table.to_pylist()
    changed = change(rows)
    rows = rows if changed is None else changed
    write_table(path, pa.Table.from_pylist(rows, schema=table.schema))


def put(folder, name, number, **values):
    edit(folder, name, lambda rows: rows[number].update(values))


def forged(value):
    """Another value of the same kind, further off than any processor rounds."""
    if isinstance(value, bool) or value is None:
        return not value
    if isinstance(value, list):
        return [forged(value[0]), *value[1:]]
    if isinstance(value, dict):
        return {key: forged(inner) for key, inner in value.items()}
    return f"{value}x" if isinstance(value, str) else 1.5 * value + 10


def test_every_table_is_known_by_columns_that_it_has():
    assert KEYS.keys() == MODEL.keys()
    for name, columns in KEYS.items():
        assert set(columns) <= MODEL[name].__dataclass_fields__.keys()


def test_the_same_audit_holds_and_its_drawing_is_not_asked(folders):
    stated, again = folders
    (stated / "scene.png").write_bytes(b"of another renderer")
    hold_audit(stated, again)


@pytest.mark.parametrize("name", sorted(MODEL))
def test_a_forged_cell_is_refused_by_name(folders, name):
    stated, again = folders
    table = read_table(stated / f"{name}.parquet")
    true = table.to_pylist()
    for column in table.column_names:
        rows = copy.deepcopy(true)
        rows[-1][column] = forged(rows[-1][column])
        kind = table.schema.field(column).type
        if true[-1][column] is None and kind != pa.bool_():
            rows[-1][column] = 1.0
        write_table(stated / f"{name}.parquet", pa.Table.from_pylist(rows, schema=table.schema))
        said = r"\w+ row" if column in KEYS[name] else column
        with pytest.raises(RefusedError, match=rf"audit/{name}\.parquet: .*{said}"):
            hold_audit(stated, again)
    write_table(stated / f"{name}.parquet", table)
    hold_audit(stated, again)


@pytest.mark.parametrize("name", sorted(MODEL))
def test_a_row_more_or_less_is_refused_by_name(folders, name):
    stated, again = folders
    true = read_table(stated / f"{name}.parquet").to_pylist()
    edit(stated, name, lambda rows: rows[:-1])
    with pytest.raises(RefusedError, match=rf"{name}\.parquet: .* is no row, required one row"):
        hold_audit(stated, again)
    edit(stated, name, lambda _: [*true, true[-1]])
    what = "stated twice" if KEYS[name] else "a row"
    with pytest.raises(RefusedError, match=rf"{name}\.parquet: .* is {what}, required no such"):
        hold_audit(stated, again)


def test_rows_in_another_order_are_refused_since_others_speak_of_them_by_place(folders):
    stated, again = folders
    edit(stated, "strata", lambda rows: rows[::-1])
    with pytest.raises(RefusedError, match=r"order is approach/epoch, required approach/operator"):
        hold_audit(stated, again)


def test_columns_of_another_name_or_kind_are_refused(folders):
    stated, again = folders
    path = stated / "modes.parquet"
    table = read_table(path)
    for other in (
        table.drop_columns(["checked"]), table.append_column("more", [["a", "b"]]),
        table.set_column(2, "episodes", table["episodes"].cast(pa.float64())),
    ):  # fmt: skip
        write_table(path, other)
        with pytest.raises(RefusedError, match=r"modes\.parquet: columns is"):
            hold_audit(stated, again)


@pytest.mark.parametrize("kind", [SUMMARY, PERSISTENCE], ids=lambda kind: kind.file)
def test_a_forged_number_or_word_of_a_document_is_refused_by_name(folders, kind):
    stated, again = folders
    true = json.loads((stated / kind.file).read_text())
    places = [(key,) for key in true if true[key] not in ({}, [])]
    places += [("counts", key) for key in true.get("counts", ())]
    for *path, key in places:
        document = copy.deepcopy(true)
        inner = document[path[0]] if path else document
        inner[key] = forged(inner[key])
        (stated / kind.file).write_bytes(canonical_json(document))
        with pytest.raises(RefusedError, match=rf"{kind.file}: .*{key}.* as measured again"):
            hold_audit(stated, again)
    for document in (true | {"more": 1}, {key: true[key] for key in list(true)[1:]}):
        (stated / kind.file).write_bytes(canonical_json(document))
        with pytest.raises(RefusedError, match=rf"{kind.file}: \w+ is .*nothing"):
            hold_audit(stated, again)


@pytest.mark.parametrize("file", ["settings.json", "modes.parquet"])
def test_a_file_that_is_not_there_is_refused(folders, file):
    stated, again = folders
    (stated / file).unlink()
    with pytest.raises(RefusedError, match=rf"audit/{file} is missing"):
        hold_audit(stated, again)


def test_last_digits_are_rounding_and_a_count_is_a_count(folders):
    stated, again = folders
    put(stated, "strata", 0, effect=0.05 * (1 + 1e-12), p_value=0.4 + 1e-10)
    hold_audit(stated, again)
    put(stated, "strata", 0, effect=0.050001)
    with pytest.raises(RefusedError, match=r"approach/operator: effect is 0\.050001, required"):
        hold_audit(stated, again)
    put(stated, "strata", 0, effect=0.05, n=101)
    with pytest.raises(RefusedError, match=r"approach/operator: n is 101, required 100, as meas"):
        hold_audit(stated, again)


def test_what_forests_found_may_be_a_little_otherwise_and_what_neighbours_found_may_not(folders):
    stated, again = folders
    for kind, rows in (("learned", 1), ("local", 0)):
        assert read_table(stated / "sides.parquet").to_pylist()[rows]["kind"] == kind
    put(stated, "sides", 1, resolved=GROWN_COUNT, analysed=85, noise_ratio=0.09, kept=0.9)
    put(stated, "reach", 1, spoke=33)
    hold_audit(stated, again)
    for name, columns in (("sides", {"resolved": 1}), ("reach", {"spoke": 35})):
        before = read_table(stated / f"{name}.parquet")
        put(stated, name, 0, **columns)
        with pytest.raises(RefusedError, match=rf"{name}\.parquet: local.*{next(iter(columns))}"):
            hold_audit(stated, again)
        write_table(stated / f"{name}.parquet", before)
    for column, value in (
        ("resolved", GROWN_COUNT + 1), ("analysed", 71), ("noise_ratio", 0.075), ("kept", 0.7),
        ("followed", True),
    ):  # fmt: skip
        before = read_table(stated / "sides.parquet")
        put(stated, "sides", 1, **{column: value})
        with pytest.raises(RefusedError, match=rf"sides\.parquet: learned: {column} is"):
            hold_audit(stated, again)
        write_table(stated / "sides.parquet", before)


def test_a_mean_of_few_situations_of_the_forests_is_not_asked_and_how_many_they_are_is(folders):
    stated, again = folders
    for folder in folders:
        put(folder, "sides", 1, kept_n=9)
    put(stated, "sides", 1, kept=0.1, kept_null_q95=1.0)
    hold_audit(stated, again)
    put(stated, "sides", 1, noise_ratio=0.9)
    with pytest.raises(RefusedError, match="learned: noise_ratio"):
        hold_audit(stated, again)
    for folder in folders:
        put(folder, "sides", 1, analysed=9)
    hold_audit(stated, again)
    put(stated, "sides", 1, resolved=GROWN_COUNT + 1)
    with pytest.raises(RefusedError, match="learned: resolved is"):
        hold_audit(stated, again)
    put(stated, "sides", 1, resolved=0)
    for folder in folders:
        put(folder, "sides", 0, kept_n=9)
    put(stated, "sides", 0, kept=0.1)
    with pytest.raises(RefusedError, match="local: kept is"):
        hold_audit(stated, again)


def test_noise_is_that_of_the_forests_where_they_looked_at_more(folders):
    stated, again = folders
    put(stated, "tremor", 0, ratio=0.11)
    with pytest.raises(RefusedError, match="x_m: ratio is"):
        hold_audit(stated, again)
    for folder in folders:
        put(folder, "sides", 1, analysed=91)
    hold_audit(stated, again)
    put(stated, "tremor", 0, ratio=0.15)
    with pytest.raises(RefusedError, match="x_m: ratio is"):
        hold_audit(stated, again)


def test_examples_of_what_is_no_mode_are_not_asked_and_those_of_modes_are(folders):
    stated, again = folders
    put(stated, "neighbourhoods", 3, mode_paths=[[0.0], [1.0]])
    with pytest.raises(RefusedError, match=r"e3/3: mode_paths\.0 is 1 of them, required 48 of"):
        hold_audit(stated, again)
    for folder in folders:
        put(folder, "neighbourhoods", 3, two_mode=False)
    hold_audit(stated, again)
    put(stated, "neighbourhoods", 3, mean_path=[0.0] * 48)
    with pytest.raises(RefusedError, match=r"e3/3: mean_path\.0 is 0\.0, required 0\.37"):
        hold_audit(stated, again)


@pytest.mark.parametrize(
    ("told", "found", "same"),
    [
        (float("nan"), float("nan"), True), (float("nan"), 1.0, False), (1.0, float("nan"), False),
        (float("inf"), float("inf"), True), (float("inf"), 1.0, False), (1.0, float("inf"), False),
        (1, True, False), (None, 0.0, False), (0.0, None, False), ("1", 1, False), (5, 5.0, True),
        (1e9 + 0.5, 1e9, True), (1e9 + 2.0, 1e9, False), ([1.0], [1.0, 1.0], False), ([], [], True),
        ({"a": [1.0, 2.0]}, {"a": [1.0, 3.0]}, False), ({"a": 1}, {"a": 1}, True),
    ],
)  # fmt: skip
def test_what_is_no_number_is_another_thing_than_a_number(told, found, same):
    assert (difference(told, found) is None) == same


SETTINGS = {
    "neighbours": 4, "minimum_neighbours": 4, "query_stride": 16, "resamples": 20,
    "permutations": 99, "replay_episodes": 2,
}  # fmt: skip


@pytest.fixture(scope="module")
def audited(dataset, kit, task, tmp_path_factory):
    """A workspace whose dataset was audited, and its settings."""
    root = tmp_path_factory.mktemp("audited")
    shutil.copytree(dataset, root / "artifacts/ingest")
    (root / "artifacts/audit").mkdir()
    params = copy.deepcopy(kit.PARAMS) | {"audit": SETTINGS, "seed": 5, "confidence": 0.9}
    horizons = HorizonConfig(**params["horizons"])
    settings = settings_of(AuditSettings(**SETTINGS), task, horizons, confidence=0.9)
    result = audit_task(
        root / "artifacts/ingest", task_name=task.name, settings=settings, root_seed=5,
        feasibility=FeasibilitySettings(**params["feasibility"]),
        action_period_s=horizons.action_period_s,
    )  # fmt: skip
    obstacles = round_obstacles(task)
    write_evidence(result, root / "artifacts/audit", settings=settings, obstacles=obstacles)
    return root, params


def test_an_audit_is_what_its_dataset_gives_and_a_forged_one_is_not(audited, tmp_path):
    root, params = audited
    rederive_audit(root, params)
    shutil.copytree(root, tmp_path / "forged")
    put(tmp_path / "forged/artifacts/audit", "replay", 0, replayed="timeout")
    with pytest.raises(RefusedError, match=r"replay\.parquet: .*: replayed is 'timeout', required"):
        rederive_audit(tmp_path / "forged", params)


def test_another_seed_or_confidence_than_that_of_the_workspace_is_refused(audited):
    root, params = audited
    for other in ({"seed": 6}, {"confidence": 0.95}):
        with pytest.raises(RefusedError, match=r"artifacts/audit/\w+\.\w+: .* is .*, required"):
            rederive_audit(root, params | other)
    with pytest.raises(ConfigError, match="confidence"):
        rederive_audit(root, {key: params[key] for key in params if key != "confidence"})


def test_gate_a_asks_it_before_modes_are_counted_where_it_says(repo, monkeypatch):
    asked = []
    monkeypatch.setattr(rederive, "rederive_trainings", lambda *_: None)
    monkeypatch.setattr(rederive, "rederive_ingest", lambda *_: asked.append("recordings"))
    monkeypatch.setattr(rederive, "rederive_policies", lambda *_: asked.append("modes"))
    monkeypatch.setattr(rederive, "rederive_audit", lambda *_: asked.append("audit"))
    rung = Rung("A", "need", "PASS", "", "", "reports/gate_a.json", 0)
    assert rederive.rederived(repo, [rung]) == [rung]
    assert asked == ["recordings", "audit", "modes"]
    for name in ("rederive_brought", "rederive_conformance", "rederive_costs"):
        monkeypatch.setattr(rederive, name, lambda *_: None)
    rederive.rederived(repo, [Rung("B", "r", "PASS", "", "", "reports/gate_b.json", 0)])
    assert asked == ["recordings", "audit", "modes", "modes"]
