"""How chunks join in rollouts: dithering between modes, blends through the post, and the record."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from genpolicy.candidates.joining import BLENDS, JoiningSettings
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.execution.journal import write_journal
from genpolicy.verification.checker import check_messages
from genpolicy.verification.rollouts import derived_with_recoveries
from genpolicy.verification.spliced import Spliced
from genpolicy.verification.tables import derived_tables

LEAD = 7
"""An invocation begins at once behind the last: plans overlap by as much as their validity lets."""
RULES = ("replace", "ensemble_oldest", "ensemble_newest", "running_average", "bidirectional")


def of_kind(rollout, kind):
    return [event.payload for event in rollout.journal.events() if event.kind == kind]


def sideways(rollout, side, *, speed=0.004):
    """Gently from the last command to one side in y; the first rows stand."""
    last = rollout.world.last_action
    chunk = np.tile(last, (16, 1))
    chunk[:, 1] += side * np.cumsum(np.minimum(speed, 0.001 * np.arange(16)))
    return chunk


def alternating(rollout):
    """Two candidates: in turns the left one first, or the right one."""
    sides = (1.0, -1.0) if rollout.invocations % 2 else (-1.0, 1.0)
    return np.stack([sideways(rollout, side) for side in sides])


def settings(kit, **changes):
    values = kit.PARAMS["execution"] | {"replan_lead_rows": LEAD} | changes
    return ExecutionSettings(**values)


@pytest.fixture(scope="module")
def played(run, kit):
    """Rollouts of 40 ticks under the alternating policy, by rule."""

    def go(rule, plan=alternating, ticks=40, **changes):
        joining = JoiningSettings(rule=rule, **changes)
        return run(
            plan, ticks=ticks, joining=joining, execution=settings(kit), latency=kit.latency(0.02),
            sampler=joining.sampler_hash("s" * 64),
        )[0]  # fmt: skip

    return go


def turns(rollout):
    """How often the commanded motion in y turns round."""
    path = np.array([action[1] for action in commanded(rollout)])
    moves = np.diff(path)
    moves = np.sign(moves[np.abs(moves) > 1e-9])
    return int(np.sum(moves[1:] != moves[:-1])), float(np.abs(path - path[0]).max())


def commanded(rollout):
    rows = [payload["action"] for payload in of_kind(rollout, "accept")]
    return [np.frombuffer(bytes.fromhex(text), dtype="<f8") for text in rows]


def test_replacing_dithers_between_two_modes_and_backward_coherence_does_not(played, kit, tmp_path):
    replaced, coherent = played("replace"), played("bidirectional")
    dithers, away_m = turns(replaced)
    straight, further_m = turns(coherent)
    assert dithers >= 5 and straight <= 1
    assert further_m > 1.4 * away_m
    for number, rollout in enumerate((replaced, coherent)):
        folder = tmp_path / str(number)
        folder.mkdir()
        report = kit.check([rollout], folder, execution=settings(kit))
        assert report.violations == [] and report.checked_actions > 20
    assert of_kind(replaced, "joined") == []
    choices = Counter(payload["draw"] for payload in of_kind(coherent, "joined"))
    assert choices[0] and choices[1]


@pytest.mark.parametrize("rule", RULES)
def test_every_rule_is_proved_from_its_journal(played, kit, tmp_path, rule):
    rollout = played(rule)
    report = kit.check([rollout], tmp_path, execution=settings(kit))
    assert report.violations == [] and report.reproved_actions > 10
    (columns,) = derived_with_recoveries(tmp_path / "journal.mcap")[0].values()
    assert columns["rejections"] == rollout.tally.rejections
    entered = of_kind(rollout, "enqueue")
    assert [splice.parents > 0 for splice in rollout.splices] == [
        bool(payload["parents"]) for payload in _made(rollout, entered)
    ]
    if rule in BLENDS:
        blends = [m["chunk_id"] for m in entered if m["chunk_id"].endswith("/blend")]
        assert len(blends) >= 3 and set(blends) <= {
            m["chunk_id"] for m in of_kind(rollout, "candidate")
        }


@pytest.mark.parametrize("rule", RULES)
def test_how_each_chunk_begins_follows_from_the_journal_too(played, task, tmp_path, rule):
    """Another library's kinematics, and nothing of what wrote the table."""
    rollout = played(rule)
    write_journal(tmp_path / "journal.mcap", [rollout.journal])
    spliced = Spliced(task.scene_path)
    derived_tables([tmp_path / "journal.mcap"], spliced)
    assert len(spliced.rows) == len(rollout.splices) > 3
    for row, splice in zip(spliced.rows, rollout.splices, strict=True):
        assert row["rule"] == rule
        for name, value in vars(splice).items():
            assert row[name] == (None if value is None else pytest.approx(value, rel=1e-6))
    assert any(row["jerk_m_s3"] for row in spliced.rows)


def _made(rollout, entered):
    made = {payload["chunk_id"]: payload for payload in of_kind(rollout, "joined")}
    return [made.get(m["chunk_id"], {"parents": {}}) for m in entered]


def test_the_two_published_signs_command_other_actions(played):
    """With a decay of ln 2 the heavier of two predictions weighs 2/3, and it is another one."""
    oldest, newest = (
        np.array(commanded(played(rule, decay=float(np.log(2.0)))))
        for rule in ("ensemble_oldest", "ensemble_newest")
    )
    count = min(len(oldest), len(newest))
    assert not np.allclose(oldest[:count], newest[:count], atol=1e-4)
    equal = [
        np.array(commanded(played(rule, decay=0.0)))
        for rule in ("ensemble_oldest", "ensemble_newest")
    ]
    assert np.array_equal(*equal)


def test_a_chunk_of_another_rule_is_refused(run, kit):
    """What made a chunk is in its sampler's hash: that of another rule does not command."""
    joining = JoiningSettings(rule="ensemble_oldest")
    (rollout,) = run(alternating, ticks=6, joining=joining, sampler=joining.sampler_hash("s" * 64))
    assert commanded(rollout)
    (other,) = run(alternating, ticks=1, joining=joining)
    assert other.setup.sampler != rollout.setup.sampler
    metadata = of_kind(rollout, "enqueue")[0]
    assert metadata["sampler"] == rollout.setup.sampler == of_kind(rollout, "active")[0]["sampler"]


# -- what the independent checker must find in a record that was changed --------------------------


def rules_of(events):
    told = [(e.kind, {"session": "s", "t": e.t, **e.payload}) for e in events]
    numbered = [(kind, {**m, "n": n}) for n, (kind, m) in enumerate(told)]
    found = {violation.rule for violation in check_messages(numbered).violations}
    return {rule for rule in found if rule.startswith("P6.") or rule.startswith("clock.")}


def changed(rollout, kind, change):
    """The events, with the payload of the last of a kind that names a parent's say changed."""
    events = rollout.journal.events()
    blends = {m["chunk_id"] for m in of_kind(rollout, "joined") if m["parents"]}
    entered = {m["chunk_id"] for m in of_kind(rollout, "enqueue")} & blends
    place = max(
        n for n, e in enumerate(events) if e.kind == kind and e.payload["chunk_id"] in entered
    )
    payload = change(dict(events[place].payload))
    kept = [] if payload is None else [replace(events[place], payload=payload)]
    return [*events[:place], *kept, *events[place + 1 :]]


@pytest.mark.parametrize(
    ("kind", "change", "rule"),
    [
        ("joined", lambda m: None, "P6.blend"),
        ("candidate", lambda m: None, "P6.blend"),
        ("candidate", lambda m: {**m, "layers": {**m["layers"], "geometric": False}}, "P6.blend"),
        ("joined", lambda m: {**m, "invocation": m["chunk_id"]}, "P6.blend"),
        ("joined", lambda m: {**m, "parents": {m["chunk_id"]: [1, 2]}}, "P6.vote"),
        ("joined", lambda m: {**m, "parents": {n: [0, 9] for n in m["parents"]}}, "P6.vote"),
        ("joined", lambda m: {**m, "parents": {"unheard of": [1, 2]}}, "P6.vote"),
        ("joined", lambda m: {**m, "rule": "bidirectional"}, "P6.rule"),
    ],
)
def test_a_record_that_does_not_bear_a_blend_is_found(played, kind, change, rule):
    rollout = played("ensemble_oldest")
    assert rules_of(rollout.journal.events()) == set()
    assert rule in rules_of(changed(rollout, kind, change))
