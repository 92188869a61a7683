"""How far each method ran follows from the rows and the plan, and from nothing that is said."""

import json

import pytest
import yaml
from test_rederive import root  # noqa: F401

from gates import rederive as module
from gates.rederive import rederive
from gates.rederive_blocks import rederive_blocks
from gates.stress.rollouts import STRESS
from genpolicy.errors import RefusedError
from genpolicy.evidence.documents.stress import BLOCKS, Blocks, folder_of_seed
from genpolicy.evidence.rows.stress import RolloutRow
from genpolicy.integrity.rows import read_rows, write_rows
from genpolicy.statistics.planned_blocks import planned_rule
from genpolicy.statistics.possible import first_out, seen_of

STARTS, BLOCK = 18, 3
LAST = STARTS // BLOCK
CONDITIONS = ("nominal", "envelope")
FURTHER = f"{STRESS}/{folder_of_seed(1)}"


def row(method, condition, start, *, won):
    """A rollout; of what else there is of it nothing is asked."""
    return RolloutRow(
        method, 0, condition, start, "ab", "success" if won else "timeout", won, 1.0, 20, 20, 0, 0,
        4, 0, 0, 0, "", False, False, 0, 0.0, None, None, None, None, 0.0, "left",
    )  # fmt: skip


def write(folder, ran, *, winner="diffusion"):
    """Rollouts of so many starts of each method, of which one wins everything."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = [
        row(method, condition, start, won=method == winner)
        for condition in CONDITIONS
        for method, starts in ran.items()
        for start in range(starts)
    ]
    write_rows(folder / "rollouts.parquet", RolloutRow, rows)
    return rows


@pytest.fixture
def params(root):  # noqa: F811
    """Those that are shipped, with few starts in two conditions against one simple method."""
    own = yaml.safe_load((root / "params.yaml").read_text())
    perturbations = own["stress"]["perturbations"]
    own["stress"] |= {
        "starts": STARTS, "block": BLOCK, "baselines": ["bc"],
        "perturbations": {name: perturbations[name] for name in CONDITIONS},
    }  # fmt: skip
    own["rehearsal"] = True
    own["stress"]["alpha"] = 0.03
    return own


@pytest.fixture
def ended(params):
    """The block end at which a candidate that wins nothing is out."""
    rule = planned_rule(
        starts=STARTS, block=BLOCK, conditions=CONDITIONS, simple=["bc"],
        margin=params["stress"]["margin"],
        alpha=params["stress"]["alpha"] / len(params["train_generators"]["samplers"]),
        rehearsal=True,
    )  # fmt: skip
    rows = [row(m, c, s, won=False) for m in ("bc", "flow") for c in CONDITIONS
            for s in range(STARTS)]  # fmt: skip
    found = first_out(rule, seen_of(rows, rule), "flow")
    assert found is not None and found[0] < STARTS - BLOCK
    return found[0]


@pytest.fixture
def stopped(root, params, ended):  # noqa: F811
    """`flow` was stopped, `diffusion` wins and ran to the end."""
    write(root / STRESS, {"bc": STARTS, "flow": ended, "diffusion": STARTS})
    say(root, {"bc": LAST, "flow": ended // BLOCK, "diffusion": LAST})
    rederive_blocks(root, params)
    return root


def say(root, last, out=None, **other):  # noqa: F811
    out = {"flow": "promotion_e_value"} if out is None else out
    said = {"block": BLOCK, "starts": STARTS, "last": last, "out": out} | other
    BLOCKS.write(root / STRESS, Blocks(**said))


def test_a_comparison_in_one_block_has_no_document(root):  # noqa: F811
    rederive(root, "D")
    say(root, {"flow": 1})
    with pytest.raises(RefusedError, match=r"blocks\.json: block is 3, required None, all starts"):
        rederive(root, "D")


def test_verification_asks_it_of_the_comparison(root, monkeypatch):  # noqa: F811
    asked = []
    monkeypatch.setattr(module, "rederive_blocks", lambda *given: asked.append(given))
    rederive(root, "D")
    assert [(given[0], given[2]) for given in asked] == [(root, [])]


def test_a_stop_one_block_too_early_is_refused(stopped, params, ended):
    write(stopped / STRESS, {"bc": STARTS, "flow": ended - BLOCK, "diffusion": STARTS})
    say(stopped, {"bc": LAST, "flow": ended // BLOCK - 1, "diffusion": LAST})
    said = rf"starts of flow is {ended - BLOCK}, required {STARTS}, by the rows"
    with pytest.raises(RefusedError, match=said):
        rederive_blocks(stopped, params)


def test_who_ran_on_is_refused(stopped, params, ended):
    write(stopped / STRESS, {"bc": STARTS, "flow": ended + BLOCK, "diffusion": STARTS})
    with pytest.raises(RefusedError, match=f"starts of flow is {ended + BLOCK}, required {ended}"):
        rederive_blocks(stopped, params)


def test_rows_of_who_was_not_out_are_refused(stopped, params, ended):
    write(stopped / STRESS, {"bc": STARTS, "flow": ended, "diffusion": STARTS - BLOCK})
    with pytest.raises(RefusedError, match=rf"starts of diffusion is {STARTS - BLOCK}, required"):
        rederive_blocks(stopped, params)
    write(stopped / STRESS, {"bc": STARTS - BLOCK, "flow": ended, "diffusion": STARTS})
    with pytest.raises(RefusedError, match=rf"starts of bc is {STARTS - BLOCK}, required {STARTS}"):
        rederive_blocks(stopped, params)


def test_a_start_that_lacks_in_one_condition_is_refused(stopped, params):
    rows = read_rows(stopped / STRESS / "rollouts.parquet", RolloutRow)
    write_rows(stopped / STRESS / "rollouts.parquet", RolloutRow, rows[:-1])
    with pytest.raises(RefusedError, match=r"rollouts of diffusion is 18 in nominal, 17 in env"):
        rederive_blocks(stopped, params)


@pytest.mark.parametrize(
    ("key", "value"),
    [("out", {}), ("out", {"flow": "reset_upper"}), ("last", {"flow": 1}), ("block", 4),
     ("starts", 19)],
)  # fmt: skip
def test_a_forged_document_is_refused_by_name(stopped, params, key, value):
    path = stopped / STRESS / BLOCKS.file
    path.write_text(json.dumps(json.loads(path.read_text()) | {key: value}))
    with pytest.raises(RefusedError, match=rf"blocks\.json: {key} is .*, by the rows"):
        rederive_blocks(stopped, params)
    path.unlink()
    with pytest.raises(RefusedError, match=r"blocks\.json: block is None, required 3"):
        rederive_blocks(stopped, params)


def test_all_ended_where_nobody_was_left(stopped, params, ended):
    write(stopped / STRESS, {"bc": ended, "flow": ended}, winner="")
    say(stopped, {"bc": ended // BLOCK, "flow": ended // BLOCK})
    rederive_blocks(stopped, params)
    write(stopped / STRESS, {"bc": STARTS, "flow": ended}, winner="")
    with pytest.raises(RefusedError, match=f"starts of bc is {STARTS}, required {ended}"):
        rederive_blocks(stopped, params)


def test_a_further_training_ran_as_far_as_the_first(stopped, params, ended):
    write(stopped / FURTHER, {"flow": ended, "diffusion": STARTS, "bc": STARTS})
    rederive_blocks(stopped, params, [FURTHER])
    write(stopped / FURTHER, {"flow": STARTS, "diffusion": STARTS, "bc": STARTS})
    said = rf"{FURTHER}: starts of flow is {STARTS}, required {ended}, as with the first"
    with pytest.raises(RefusedError, match=said):
        rederive_blocks(stopped, params, [FURTHER])
