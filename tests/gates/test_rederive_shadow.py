"""Gate C's evidence has second witnesses: its journal, and mutants that are tried again."""

import json
import shutil
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from makers import maker, write_policy

from gates import rederive_shadow as module
from gates.rederive import rederive
from gates.rederive_shadow import SHADOW, rederive_shadow
from genpolicy.errors import BadInputError, ConfigError, IntegrityError, RefusedError
from genpolicy.evidence.documents.gallery import GALLERY
from genpolicy.evidence.documents.shadow import EXECUTION, ExecutionMutant, LayerMutant
from genpolicy.evidence.rows.shadow import (
    CandidateRow,
    ShadowCountRow,
    ShadowHoldRow,
    ShadowStubRow,
)
from genpolicy.evidence.shadow.gallery import gallery_of
from genpolicy.evidence.shadow.layer_margins import gauges_of
from genpolicy.evidence.shadow.observations import held_out_observations
from genpolicy.evidence.shadow.settings import ShadowSection
from genpolicy.evidence.shadow.shadow import Shadow, shadow_policy
from genpolicy.evidence.shadow.tables import write_shadow
from genpolicy.execution.cell import Cell
from genpolicy.execution.journal import Journal, write_journal
from genpolicy.integrity.rows import read_rows, write_rows
from genpolicy.integrity.tables import read_table
from genpolicy.seeds import stream
from genpolicy.verification.shadow import KEYS

ROWS = {
    "candidates": CandidateRow,
    "stub": ShadowStubRow,
    "counts": ShadowCountRow,
    "holds": ShadowHoldRow,
}
LAYERS_TRIED = [
    LayerMutant(
        check="shape", layer="representation", fixture="shape", behind=[], detected=True, tried=3,
        violations=3, not_applicable="",
    )
]  # fmt: skip
EXECUTION_TRIED = ExecutionMutant(
    check="expired", layer=EXECUTION, detected=True, violations=2, rules=["P1"],
    violations_unchanged=0,
    slipped=0,
)  # fmt: skip


MOMENTS = module._moments
TABLES = "genpolicy.evidence.shadow.tables"


def _only_one_is_tried(patch):
    """Of the rows of the table, and of places and clauses none: they take a second each time."""
    patch.setattr(f"{TABLES}.run_mutants", lambda: [EXECUTION_TRIED])
    for others in ("place_mutants", "clause_mutants", "continuity_mutants"):
        patch.setattr(f"{TABLES}.{others}", list)


class Demonstrator:
    """Answers with what the operator did, with a NaN, and with a gripper that opens too far."""

    method, stochastic = "operator", True
    checkpoint_hash, sampler_config_hash = maker(method)

    def __init__(self, observations):
        self.chunks = {(o.episode_uuid, o.index): o.demonstrated for o in observations}

    def sample(self, seen, *, noise_names, candidates, prefix=None):
        assert prefix is None  # Gate C draws from nothing that went before
        good = np.stack([self.chunks[name[1:]] for name in noise_names])
        wide = good.copy()
        wide[:, 5:, -1] = 0.2
        actions = np.stack([good, np.full_like(good, np.nan), wide], axis=1)
        return SimpleNamespace(actions=actions, nfe=1)


@pytest.fixture(scope="module")
def params(kit):
    shadow = {"observations": 6, "samples": 2, "late_rows": 1, "mutant_observations": 1}
    return {**kit.PARAMS, "shadow": shadow}


@pytest.fixture(scope="module")
def written(params, task, checker, data, kit, tmp_path_factory):
    """The shadow evidence of one method, with two situations of two modes."""
    root = tmp_path_factory.mktemp("shadow")
    section = ShadowSection(**params["shadow"])
    shadow = Shadow(
        task=task, checker=checker, cell=Cell(kit.HORIZONS, kit.EXECUTION),
        late_rows=section.late_rows, samples=section.samples,
    )  # fmt: skip
    seen = held_out_observations(
        data, horizons=kit.HORIZONS, count=section.observations,
        generator=stream(params["seed"], "shadow", "observations"),
    )  # fmt: skip
    first, more = seen[:2], seen[2:4]
    seed = params["policy"]["seeds"][0]
    found = shadow_policy(shadow, Demonstrator(seen), first, seed=seed, two_mode=more)
    (root / SHADOW).mkdir(parents=True)
    with pytest.MonkeyPatch.context() as patch:
        _only_one_is_tried(patch)
        gallery = gallery_of(shadow, seen, found.candidates)
        write_shadow(
            root / SHADOW, [found], LAYERS_TRIED, gallery, cell=shadow.cell, robot=checker.cell
        )
    (root / "params.yaml").write_text(yaml.safe_dump(params))
    write_policy(root, "operator", seed=seed)
    return root


@pytest.fixture(scope="module")
def moments(dataset, params, tmp_path_factory):
    """What the shadow test ran with, read once."""
    root = tmp_path_factory.mktemp("moments")
    shutil.copytree(dataset, root / module.DATASET)
    return MOMENTS(root, params)


@pytest.fixture
def root(written, moments, data, tmp_path, monkeypatch):
    """A copy to forge; mutants are tried in a test of their own, since they take a while."""
    monkeypatch.setattr(module, "_moments", lambda root, params: moments)
    monkeypatch.setattr(module, "missing_checks_evidence", lambda *_: list(LAYERS_TRIED))
    _only_one_is_tried(monkeypatch)
    demonstrator = Demonstrator(moments[1])
    monkeypatch.setattr("gates.rederive_draws.loaded_on", lambda *_: demonstrator)
    monkeypatch.setattr("gates.rederive_draws.AnsweringPolicy", lambda own: own)
    monkeypatch.setattr("gates.rederive_draws.load_dataset", lambda folder: data)
    return shutil.copytree(written, tmp_path / "repo")


def rows_of(root, name):
    return read_table(root / SHADOW / f"{name}.parquet").to_pylist()


def write(root, name, rows):
    write_rows(root / SHADOW / f"{name}.parquet", ROWS[name], [ROWS[name](**row) for row in rows])


def test_candidates_that_the_named_checkpoint_does_not_draw_are_refused(root, moments, monkeypatch):
    other = Demonstrator(moments[1])
    other.chunks = {key: chunk + 2e-5 for key, chunk in other.chunks.items()}
    monkeypatch.setattr("gates.rederive_draws.loaded_on", lambda *_: other)
    with pytest.raises(RefusedError, match=r"candidate operator/held_out/0/0 is up to 2e-05"):
        rederive(root, "C")


def test_true_evidence_stands(root):
    rederive(root, "C")
    fixtures = {row["fixture"] for row in rows_of(root, "candidates")}
    assert {"held_out", "two_modes", "expired"} <= fixtures
    assert "two_modes" not in {row["fixture"] for row in rows_of(root, "stub")}


FORGED = {
    "dynamic": False, "outcome": "unknown", "first_reason": "expired", "first_row": 15,
    "mode": "left", "layer_margin": 9.0, "margin_unit": "kg",
    "position_change_m": 0.0001, "rotation_change_rad": 0.5, "boundary_jerk_m_s3": 1.0,
    "phase": "release", "situation": "elsewhere:1", "seed": 77,
    "margin_layer": "fresh", "margin_check": "expired", "outcome_contact": "unknown",
    "check_kinematic": "singular", "margin_kinematic": 0.9, "unit_kinematic": "m",
    "share_kinematic": 0.9, "row_kinematic": 3,
}  # fmt: skip


@pytest.mark.parametrize("fixture", ["held_out", "two_modes"])
@pytest.mark.parametrize("column", FORGED)
def test_a_forged_cell_of_a_candidate_is_refused_by_name(root, column, fixture):
    rows = rows_of(root, "candidates")
    place = next(i for i, row in enumerate(rows) if row["fixture"] == fixture)
    rows[place][column] = FORGED[column]
    write(root, "candidates", rows)
    said = rf"candidate operator/{fixture}/\d/0: {column} is .*as its journal says"
    with pytest.raises(RefusedError, match=said):
        rederive(root, "C")


@pytest.mark.parametrize("column", ["raw", "projected", "margins"])
def test_forged_actions_of_a_candidate_are_refused(root, column):
    rows = rows_of(root, "candidates")
    rows[0][column] = [rows[0][column][0] + 1e-9, *rows[0][column][1:]]
    write(root, "candidates", rows)
    with pytest.raises(RefusedError, match=rf"candidate operator/\w+/0/0: {column}_sha256 is"):
        rederive(root, "C")


WIDER = {
    "margin_kinematic": 0.9, "share_kinematic": 0.9, "check_kinematic": "singular",
    "unit_kinematic": "1", "outcome_kinematic": "failed",
}  # fmt: skip


@pytest.mark.parametrize("column", WIDER)
def test_what_a_layer_states_follows_from_the_margins_of_its_checks(root, moments, column):
    """Whoever forges the journal too forges the margins of all checks, or is found here."""
    rows = read_rows(root / SHADOW / "candidates.parquet", CandidateRow)
    gauges = gauges_of(moments[0].checker)
    module._hold_margins(rows, gauges)
    own = replace(rows[0], **{column: WIDER[column]})
    said = rf"operator/\w+/0/0: {column} is {WIDER[column]!r}.* as the margins of its checks give"
    with pytest.raises(RefusedError, match=said):
        module._hold_margins([own], gauges)


def test_margins_of_fewer_checks_are_refused(root, moments):
    rows = read_rows(root / SHADOW / "candidates.parquet", CandidateRow)
    short = replace(rows[0], margins=rows[0].margins[:-1])
    with pytest.raises(RefusedError, match=r"margins is 41, .*those of 42 checks"):
        module._hold_margins([short], gauges_of(moments[0].checker))


def test_a_limit_that_is_another_now_is_found(root, moments):
    """A share is of the limit in force; what was judged by another one has other shares."""
    rows = read_rows(root / SHADOW / "candidates.parquet", CandidateRow)
    gauges = gauges_of(moments[0].checker)
    wider = {
        layer: {name: replace(gauge, scale=2 * gauge.scale) for name, gauge in own.items()}
        for layer, own in gauges.items()
    }
    with pytest.raises(RefusedError, match="share_"):
        module._hold_margins(rows, wider)


def test_the_margins_are_held_where_a_report_is_verified(root, monkeypatch):
    held = []
    monkeypatch.setattr(module, "_hold_margins", lambda rows, gauges: held.extend(rows))
    rederive(root, "C")
    assert len(held) == len(rows_of(root, "candidates"))


@pytest.mark.parametrize(("name", "column"), [
    ("stub", "delivered"), ("stub", "arrivals"), ("stub", "stale"), ("stub", "invalid"),
    ("counts", "generated"), ("counts", "executed"), ("counts", "queued"), ("counts", "count"),
    ("holds", "count"),
])  # fmt: skip
def test_a_forged_count_is_refused_by_name(root, name, column):
    rows = rows_of(root, name)
    rows[0][column] += 1
    write(root, name, rows)
    with pytest.raises(RefusedError, match=rf"{name.removesuffix('s')} operator/.*: {column} is"):
        rederive(root, "C")


@pytest.mark.parametrize("name", KEYS)
def test_rows_that_are_left_out_or_stated_twice_are_found(root, name):
    rows = rows_of(root, name)
    write(root, name, rows[1:])
    with pytest.raises(RefusedError, match="only in a journal"):
        rederive(root, "C")
    write(root, name, [*rows, rows[0]])
    with pytest.raises(RefusedError, match="stated twice"):
        rederive(root, "C")
    key = KEYS[name][-1]
    write(root, name, [*rows, {**rows[0], key: 99 if key == "candidate" else "made up"}])
    with pytest.raises(RefusedError, match="without a journal"):
        rederive(root, "C")


@pytest.mark.parametrize("forge", [
    lambda rows: rows[:-1], lambda rows: rows[1:], lambda rows: [*rows, rows[0]],
    lambda rows: [{**rows[0], "detected": False}, *rows[1:]],
    lambda rows: [*rows[:-1], {**rows[-1], "violations": 5}],
])  # fmt: skip
def test_mutants_that_are_not_those_found_again_are_refused(root, forge):
    path = root / SHADOW / "mutants.json"
    path.write_text(json.dumps(forge(json.loads(path.read_text()))))
    with pytest.raises(RefusedError, match=r"mutants\.json: .*as tried again"):
        rederive(root, "C")


@pytest.mark.parametrize("forge", [
    lambda rows: {"check": "shape"}, lambda rows: [*rows, "shape"],
])  # fmt: skip
def test_mutants_of_another_form_are_bad_input(root, forge):
    path = root / SHADOW / "mutants.json"
    path.write_text(json.dumps(forge(json.loads(path.read_text()))))
    with pytest.raises(IntegrityError, match=r"mutants\.json is a document with"):
        rederive(root, "C")


def test_the_checks_are_left_out_again_on_the_moments_of_the_dataset(
    written, params, dataset, tmp_path, monkeypatch
):
    root = shutil.copytree(written, tmp_path / "repo")
    shutil.copytree(dataset, root / module.DATASET)
    seen = []
    monkeypatch.setattr(
        module, "missing_checks_evidence",
        lambda shadow, observations: seen.append((shadow, observations)) or LAYERS_TRIED,
    )  # fmt: skip
    _only_one_is_tried(monkeypatch)
    rederive_shadow(root, params)
    ((shadow, observations),) = seen
    assert len(observations) >= params["shadow"]["mutant_observations"]
    assert (shadow.samples, shadow.late_rows) == (2, 1)
    with pytest.raises(ConfigError, match=r"seed is True, expected a whole number"):
        rederive_shadow(root, {**params, "seed": True})


def edited(root, change):
    path = root / SHADOW / GALLERY.file
    document = json.loads(path.read_text())
    path.write_text(json.dumps(change(document) or document))


@pytest.mark.parametrize("change", [
    lambda d: d["examples"].pop(), lambda d: d["examples"].reverse(),
    lambda d: d["examples"].append(d["examples"][0]), lambda d: d.update(examples=[]),
    lambda d: d["workspace_m"][0].reverse(), lambda d: d.update(action_period_s=0.1),
    lambda d: d["examples"][0].update(margin=-1e-6), lambda d: d["examples"][0].update(row=15),
    lambda d: d["examples"][0].update(rejected=99), lambda d: d["examples"][0].update(limits=[9.0]),
    lambda d: d["examples"][-1]["raw_m"].reverse(), lambda d: d["examples"][0]["raw_m"].pop(),
    lambda d: d["examples"][0]["projected_m"].__setitem__(2, [0.5, 0.0, 0.1]),
    lambda d: d["examples"][0]["bodies"].pop(), lambda d: d["examples"][0].update(touching=["a"]),
])  # fmt: skip
def test_a_gallery_that_is_not_what_the_layers_say_again_is_refused(root, change):
    assert len(json.loads((root / SHADOW / GALLERY.file).read_text())["examples"]) >= 2
    edited(root, lambda document: change(document) and None)
    with pytest.raises(RefusedError, match=r"gallery\.json: .*as judged again"):
        rederive(root, "C")


def test_a_gallery_that_is_missing_is_bad_input(root):
    (root / SHADOW / GALLERY.file).unlink()
    with pytest.raises(BadInputError, match=r"gallery\.json"):
        rederive(root, "C")


def test_the_layers_are_asked_and_not_the_table_alone(root, dataset, monkeypatch):
    """Table, journal and gallery that agree, and layers of today that admit the example."""
    monkeypatch.setattr(module, "_moments", MOMENTS)
    shutil.copytree(dataset, root / module.DATASET)
    settings = yaml.safe_load((root / "params.yaml").read_text())
    settings["feasibility"] = {**settings.get("feasibility", {}), "gripper_tolerance_m": 0.5}
    (root / "params.yaml").write_text(yaml.safe_dump(settings))
    with pytest.raises(IntegrityError, match="what the layers say"):
        rederive(root, "C")


def test_an_event_that_cannot_be_read_is_bad_input(root):
    journal = Journal("operator/held_out/0", {})
    journal.add("candidate", 0, {"chunk_id": "a"})
    path = root / SHADOW / "journal.mcap"
    write_journal(path, [journal])
    with pytest.raises(BadInputError, match="an event that cannot be read"):
        rederive_shadow(root, {})
    path.write_bytes(b"journal")
    with pytest.raises(BadInputError, match="no journal"):
        rederive_shadow(root, {})
