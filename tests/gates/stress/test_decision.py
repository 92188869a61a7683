"""The benchmark of Gate D's decisions counts what it says, through the gate's own functions."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.decision import rule, tables
from benchmarks.decision.__main__ import (
    WHOLE,
    arguments,
    code_of,
    hash_of,
    kept,
    of_world,
    planned,
    rule_alone,
    whole_gate,
)
from benchmarks.decision.catalogue import GRADED, WORLDS
from benchmarks.decision.worlds import CONDITIONS, World, draw, outcomes
from gates.stress import gains
from gates.stress.weights import LEAST_OF_A_SUCCESS
from genpolicy.seeds import stream
from genpolicy.statistics.eprocess import paired_e_value

ROOT = Path(__file__).parents[3]
BY_NAME = {world.name: world for world in WORLDS}


@pytest.fixture(scope="module")
def shipped():
    return planned(ROOT)


def test_outcomes_have_the_shares_of_the_world_and_are_tied_as_it_says():
    shares = np.array([[0.5] * 8, [0.8] * 8])
    won = outcomes(shares, 4000, 0.3, 0.5, stream(1, "a"))
    assert won.mean(axis=(1, 2)) == pytest.approx([0.5, 0.8], abs=0.02)
    # As in `simulate_pairs`: .3 of the pairs share a draw, so a loss happens in .7 * .5 * .2.
    assert (won[1] < won[0]).mean() == pytest.approx(0.07, abs=0.01)
    # Half of the starts end alike in all conditions, the others by chance.
    alike = (won[0] == won[0][:1]).all(axis=0).mean()
    assert alike == pytest.approx(0.5 + 0.5 * 2 * 0.5**8, abs=0.03)
    tied = outcomes(shares, 300, 1.0, 1.0, stream(1, "b"))
    assert (tied == tied[:, :1]).all() and (tied[1] >= tied[0]).all()


def test_every_world_at_the_margin_gains_the_margin_and_no_more():
    for name in ("margin", "low", "high", "one_condition", "three"):
        world = BY_NAME[name]
        drawn = draw(world, 10, stream(1, name))
        gains_ = drawn.of_method.mean(axis=1) - drawn.simple.mean(axis=1).max()
        assert gains_ == pytest.approx([0.05] * len(world.candidates))


def test_graded_worlds_at_the_margin_gain_the_margin_as_they_are_drawn():
    """Utilities are 0, the floor or 1; their means are the true ones, and gain what is said."""
    for world in GRADED[:4]:
        drawn = draw(world, 4000, stream(1, world.name))
        assert set(np.unique(drawn.candidates)) <= {0.0, LEAST_OF_A_SUCCESS, 1.0}
        own, simple = drawn.candidates.mean(axis=(1, 2)), drawn.baselines.mean(axis=(1, 2))
        assert own == pytest.approx(drawn.truth.mean(axis=1), abs=0.03)
        assert simple == pytest.approx(world.baselines, abs=0.03)
        assert own[0] - simple.max() == pytest.approx(0.05, abs=0.03)


def test_the_whole_gate_says_of_graded_outcomes_what_the_rule_says(shipped):
    settings, limits, section = shipped
    cheaper = next(world for world in WHOLE if world.name == "graded_cheaper")
    found = whole_gate(cheaper, settings, limits, section, 1)
    assert found["verdicts"] == {"PASS": 1}  # all succeed, the candidate at less cost


def test_a_trial_is_drawn_the_same_again_and_another_is_another():
    world = BY_NAME["spread_3_0.1"]
    one, same, other = (draw(world, 20, stream(13, "decision", n)) for n in (1, 1, 2))
    assert one.candidates.tobytes() == same.candidates.tobytes() != other.candidates.tobytes()
    assert set(np.unique(one.candidates * 3)) <= {0.0, 1.0, 2.0, 3.0} and len(one.truth) == 1


def test_a_rule_that_promotes_everybody_is_counted_as_wrong(shipped, monkeypatch):
    world, settings = BY_NAME["never"], shipped[0]
    assert rule_alone(world, settings, 3)["hits"] == {"false": 0}

    def anything(differences, inside, settings):
        return gains.Least(99.0, next(iter(differences)), 1.0, inside, 1e6)

    monkeypatch.setattr(rule, "least_gain", anything)
    assert rule_alone(world, settings, 3)["hits"] == {"false": 3}


def test_what_a_share_is_of(shipped):
    """One promoted of two that differ: whose gain it is decides what is counted."""
    world = BY_NAME["two_apart"]
    own = of_world(shipped[0], world)
    assert own.alpha == pytest.approx(shipped[0].alpha)
    drawn = draw(world, 20, stream(1, "c"))
    alone = rule.Told(("FAIL", "PASS"), "candidate_1", alone=True)
    said = {asks: rule.counted(asks, drawn, alone, 0.05, own.candidates) for asks in rule.COUNTS}
    assert [asks for asks, hit in said.items() if hit] == ["promoted", "worse"]
    either = replace(alone, verdicts=("PASS", "PASS"), alone=False)
    assert rule.counted("either", drawn, either, 0.05, own.candidates)
    assert not rule.counted("worse", drawn, either, 0.05, own.candidates)
    higher = replace(drawn, truth=drawn.truth - 0.3)
    assert rule.counted("false", higher, alone, 0.05, own.candidates)
    assert not rule.counted("false_of_method", higher, alone, 0.05, own.candidates)


def test_a_peeker_asks_at_every_look_of_the_rollouts_so_far_and_ends_at_the_first_pass(
    shipped, monkeypatch
):
    """Won by the candidate from the first thirty starts alone, or from none."""
    world = BY_NAME["alone"]
    own = of_world(shipped[0], world)
    drawn = draw(world, 90, stream(1, "d"))
    drawn = replace(drawn, baselines=np.zeros_like(drawn.baselines))
    looks = []

    def spied(differences, inside, settings):
        looks.extend({len(pairs) for pairs in (*differences.values(), inside.differences)})
        return gains.least_gain(differences, inside, settings)

    monkeypatch.setattr(rule, "least_gain", spied)
    won = np.tile(np.where(np.arange(90) < 30, 1.0, 0.0), (1, 8, 1))
    needed = paired_e_value(won[0, 0], margin=own.margin, alpha=own.alpha).pairs_needed
    assert needed is not None and needed <= 10  # so the first of the looks is enough
    assert rule.told(replace(drawn, candidates=won), own, 10).verdicts == ("PASS",)
    assert looks == [10]
    looks.clear()
    late = np.roll(won, 25, axis=2)  # nothing is won before the 26th start
    assert rule.told(replace(drawn, candidates=late), own, 10).verdicts == ("PASS",)
    assert looks[:3] == [10, 20, 30] and len(looks) < 9
    looks.clear()
    assert rule.told(replace(drawn, candidates=0.0 * won), own, 20).verdicts == ("FAIL",)
    assert looks == [20, 40, 60, 80, 90]
    looks.clear()
    assert rule.told(replace(drawn, candidates=won), own).verdicts == ("PASS",)
    assert looks == [90]


def latest(differences, *, margin, alpha):
    """The e-process by the evidence at hand, which a later start may take back."""
    found = paired_e_value(differences, margin=margin, alpha=alpha)
    return replace(found, e_value=float(found.path[-1]))


def test_who_peeks_at_every_start_is_told_what_the_last_look_says(shipped, monkeypatch):
    """The evidence is its highest so far; by the evidence at hand a peeker would pass oftener."""
    world = replace(BY_NAME["alone"], candidates=(0.68,))
    own = of_world(shipped[0], world)
    trials = [draw(world, 90, stream(1, "peeking", number)) for number in range(25)]

    def passed(looks):
        return [rule.told(drawn, own, looks).verdicts for drawn in trials]

    once, always = passed(0), passed(1)
    assert once == always
    assert 5 <= once.count(("PASS",)) <= 20  # either is told
    monkeypatch.setattr(gains, "paired_e_value", latest)
    once, always = passed(0), passed(1)
    assert once.count(("PASS",)) < always.count(("PASS",))


def test_the_whole_gate_says_of_the_gain_what_the_rule_says(shipped):
    settings, limits, section = shipped
    assert set(settings.perturbations) == set(CONDITIONS)
    for world in (WHOLE[1], WHOLE[2]):
        found = whole_gate(world, settings, limits, section, 1)
        assert sum(found["verdicts"].values()) == 1
        assert ("promotion_e_value" in found["unmet"]) == (world.name == "at_the_margin")


def test_a_share_is_judged_at_the_worse_end():
    world = World("a", "b", ("false",), (0.5,), (0.55,), most=0.05)
    assert [tables.kept(world, 0, n) for n in (40, 10_000)] == [False, True]
    assert tables.kept(replace(world, most=None, least=0.8), 82, 100) is False
    assert tables.kept(replace(world, most=None), 82, 100) is None
    page = "x <!-- begin of p -->\nold\n<!-- end of p --> y"
    assert tables.into_page(page, "p", "new") == (
        "x <!-- begin of p -->\n\nnew\n<!-- end of p --> y"
    )
    with pytest.raises(ValueError, match="begin of q"):
        tables.into_page(page, "q", "new")


def test_a_result_counts_only_for_what_it_was_of(tmp_path):
    runs = []

    def run():
        runs.append(1)
        return {"name": "a", "trials": 5, "seconds": 0.0, "run": len(runs)}

    path = tmp_path / "a.json"
    assert kept(path, 5, "one", run)["run"] == kept(path, 5, "one", run)["run"] == 1
    assert kept(path, 5, "other", run)["run"] == 2 and kept(path, 5, "other", run)["run"] == 2
    assert kept(path, 6, "other", run)["run"] == 3
    path.write_text('{"trials": 5, "run": 0}')  # of a runner that said of nothing what it was of
    assert kept(path, 5, "other", run)["run"] == 4


def test_code_settings_limits_and_world_are_in_the_hash(shipped, tmp_path):
    settings, limits, section = shipped
    world = BY_NAME["margin"]
    others = {
        hash_of("code", world, settings, limits, section),
        hash_of("edited", world, settings, limits, section),
        hash_of("code", replace(world, methods_alike=0.4), settings, limits, section),
        hash_of("code", world, settings.model_copy(update={"margin": 0.1}), limits, section),
        hash_of("code", world, settings, replace(limits, waived={}, of={}), section),
        hash_of("code", world, settings, limits, section.model_copy(update={"alpha": 0.1})),
    }
    assert len(others) == 6
    assert hash_of("code", world, *shipped) == hash_of("code", world, *planned(ROOT))


@pytest.mark.parametrize(
    "place",
    ["gates/stress/gains.py", "genpolicy/statistics/eprocess.py", "benchmarks/decision/rule.py"],
)
def test_an_edit_of_the_rule_is_other_code(tmp_path, place):
    for part in ("gates", "genpolicy", "benchmarks/decision"):
        shutil.copytree(ROOT / part, tmp_path / part)
    assert code_of(tmp_path) == code_of(ROOT)
    (tmp_path / place).write_text((ROOT / place).read_text() + "\n")
    assert code_of(tmp_path) != code_of(ROOT)


def test_the_page_shows_as_many_trials_as_its_command_asks_for():
    page = (ROOT / "docs" / "decision-accuracy.md").read_text()
    asked = arguments([])
    shown_in = {"promotion": (3, asked.trials), "graded": (3, asked.graded),
                "whole": (2, asked.whole)}  # fmt: skip
    for name, (column, trials) in shown_in.items():
        table = page.partition(tables.BEGIN.format(name))[2].partition(tables.END.format(name))[0]
        rows = [line.split("|") for line in table.splitlines() if line.startswith("| ")]
        shown = {row[column].strip() for row in rows if row[1].strip() != "world"}
        assert shown == {f"{trials:,}"}
