"""Absence takes support along the whole way, and noise takes a share of what was looked at."""

import math
from dataclasses import replace

import pytest
from planted import HIDDEN, LIMITS, TOLD, VALID, counts, learned, limit, named

from gates.cause import CauseName
from genpolicy.audit.component_rows import Tremor
from genpolicy.audit.variable import INSIDE

ABSENT = counts(two_mode_episodes=0, two_mode=0, persistent=0)


def reach(*shares):
    rows = zip(VALID.reach, shares, strict=True)
    return tuple(replace(row, queries=100, spoke=round(100 * share)) for row, share in rows)


def test_one_action_is_not_said_where_situations_crowd_at_the_end():
    crowded = replace(ABSENT, reach=reach(0.3, 0.4, 0.6, 0.9, 1.0))
    cause = named(crowded)
    assert (cause.name, cause.kind) == (CauseName.INSUFFICIENT_SUPPORT, "neighbourhoods")
    assert "first (30%), second (40%)" in cause.next_action
    along = replace(ABSENT, reach=reach(0.5, 0.5, 0.6, 0.9, 1.0))
    assert named(along).name is CauseName.UNIMODAL
    # Modes that were seen are not denied by what could not be looked at.
    assert named(replace(VALID, reach=crowded.reach)).name is CauseName.VALID_MODES


@pytest.mark.parametrize(
    ("episodes", "name", "kind"),
    [(0, "unimodal", ""), (5, "unimodal", ""), (8, "unimodal", ""),
     (9, "insufficient_support", "few_clusters")],
)  # fmt: skip
def test_clusters_surely_more_often_than_by_luck_are_not_denied(episodes, name, kind):
    """Nine of 48: modes take a fifth, and luck gives less than a tenth in 19 of 20 cases."""
    few = {"two_mode": 3 * episodes, "two_mode_episodes": episodes, "persistent": 0}
    cause = named(counts(**few, primary_episodes=48))
    assert (cause.name.value, cause.kind) == (name, kind)
    assert ("9 of 48 held-out episodes: more than chance gives (10%)" in cause.next_action) == (
        episodes == 9
    )


@pytest.mark.parametrize(("apart", "name"), [(60, "unimodal"), (900, "pointwise_noise")])
def test_a_handful_of_clusters_that_fall_apart_is_no_noise(apart, name):
    numbers = counts(
        two_mode_episodes=0, two_mode=0, persistent=0, queries=2400, analysed=2378, incoherent=apart
    )
    assert named(numbers).name.value == name


def test_white_noise_must_be_a_share_of_what_chunks_differ_by():
    trembling = {"noise_ratio": 0.9, "noise_spread": 0.01, "two_mode_episodes": 0}
    assert named(counts(**trembling, white_share=0.3)).name is CauseName.POINTWISE_NOISE
    assert named(counts(**trembling, white_share=0.05)).name is CauseName.UNIMODAL


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({}, "pointwise_noise"),
        ({"ratio": 0.3}, "unimodal"),  # smooth from action to action
        ({"spread": 0.05}, "unimodal"),  # less than two of thirty millimetres
        ({"white_share": 0.05}, "unimodal"),  # next to nothing of why chunks differ
    ],
)
def test_one_number_that_trembles_is_named(changes, name):
    calm = Tremor("x", 0.1, 0.5, 0.08)
    shaking = replace(Tremor("elbow", 0.9, 0.13, 0.7), **changes)
    cause = named(replace(ABSENT, tremors=(calm, shaking)))
    assert cause.name.value == name
    assert cause.variable == ("elbow" if name == "pointwise_noise" else "")
    # Modes that were seen are no tremor.
    assert named(replace(VALID, tremors=(calm, shaking))).name is CauseName.VALID_MODES


THIN = counts(two_mode_episodes=0, two_mode=0, persistent=0, analysed=0, analysed_episodes=0)


def _short_lived(modes):
    """The other evidence with modes in situations that end too soon to see them persist."""
    found = learned(modes=modes)
    return found | {"other": replace(found["other"], kept_n=20)}


@pytest.mark.parametrize(
    ("numbers", "name", "kind"),
    [
        # Where neighbours are missing the other evidence speaks, as far as it reaches.
        (replace(THIN, **learned()), "unimodal", ""),
        (replace(THIN, **learned(modes=40)), "valid_modes", ""),
        (replace(THIN, **learned(spoke=0.1)), "insufficient_support", "neighbourhoods"),
        (replace(THIN, **learned(spoke=0.4)), "insufficient_support", "neighbourhoods"),
        (replace(THIN, reach=reach(0, 0, 0, 0, 0)), "insufficient_support", "neighbourhoods"),
        # Where both speak they must agree.
        (replace(ABSENT, **learned()), "unimodal", ""),
        (replace(ABSENT, **learned(modes=40)), "insufficient_support", "evidence_disagrees"),
        (replace(VALID, **learned(modes=40)), "valid_modes", ""),
        (replace(VALID, **learned(confirmed=2, contradicted=60)), "insufficient_support",
         "evidence_disagrees"),
        (replace(VALID, **learned(confirmed=20, contradicted=38)), "valid_modes", ""),
        (replace(VALID, **learned(confirmed=0, contradicted=5)), "valid_modes", ""),
        # What is too thin to deny here is denied by the other, and by nothing that is thin as well.
        (replace(ABSENT, reach=reach(0.3, 0.4, 0.6, 0.9, 1.0), **learned()), "unimodal", ""),
        (replace(ABSENT, reach=reach(0.3, 0.4, 0.6, 0.9, 1.0), **learned(spoke=0.4)),
         "insufficient_support", "neighbourhoods"),
        # Modes of the other count where it speaks, also where they go on too short to persist.
        (replace(ABSENT, **learned(modes=40, spoke=0.1)), "unimodal", ""),
        (replace(ABSENT, **_short_lived(modes=20)), "insufficient_support", "evidence_disagrees"),
        (replace(ABSENT, **_short_lived(modes=0)), "unimodal", ""),
    ],
)  # fmt: skip
def test_two_kinds_of_evidence_speak_for_each_other_and_must_agree(numbers, name, kind):
    cause = named(numbers)
    assert (cause.name.value, cause.kind) == (name, kind)


@pytest.mark.parametrize(("modes", "kind"), [(0, ""), (1, "evidence_disagrees")])
def test_one_episode_with_modes_is_a_contradiction_where_one_is_enough(modes, kind):
    floors = {**VALID.floors, "two_mode_episodes": 1, "two_mode_share": 0.02}
    numbers = replace(ABSENT, floors=floors, **_short_lived(modes=modes))
    assert named(numbers, limit(two_mode_episodes=1, two_mode_share=0.02)).kind == kind


@pytest.mark.parametrize(
    ("limits", "name"),
    [
        ({}, "valid_modes"),
        ({"contradicted_situations": 20}, "insufficient_support"),
        ({"contradicted_situations": 20, "confirmed_share": 0.05}, "valid_modes"),
    ],
)
def test_how_many_must_contradict_and_confirm_is_a_limit(limits, name):
    numbers = replace(VALID, **learned(confirmed=2, contradicted=25))
    assert named(numbers, limit(**limits)).name.value == name


FEW = replace(VALID, kept=replace(VALID.kept, n=29))
TELLS = replace(TOLD, told=0.8, told_lower=0.6, told_upper=0.9)


@pytest.mark.parametrize(
    ("row", "name", "variable"),
    [
        # What holds for an episode and explains the modes lasts as long as they do.
        (HIDDEN, "hidden_state", "operator"),
        (replace(HIDDEN, observed=True), "unimodal", "operator"),
        (replace(HIDDEN, variable="start_position.0", observed=True), "unimodal",
         "start_position.0"),
        (replace(HIDDEN, variable="zq7"), "hidden_state", "zq7"),
        # What changes inside an episode does not; nor does what explains too little, or by chance.
        (replace(HIDDEN, variable="time_in_episode", detail=INSIDE), "insufficient_support", ""),
        (replace(HIDDEN, variable="subtask", detail=INSIDE), "insufficient_support", ""),
        (replace(HIDDEN, variable="history", detail="x at first"), "insufficient_support", ""),
        (replace(HIDDEN, variable="grip.width", observed=True), "insufficient_support", ""),
        (replace(HIDDEN, effect=0.2, effect_lower=0.1), "insufficient_support", ""),
        (replace(HIDDEN, effect_lower=0.05), "insufficient_support", ""),
        (replace(HIDDEN, p_adjusted=0.2), "insufficient_support", ""),
    ],
)  # fmt: skip
def test_few_situations_are_enough_where_an_episode_tells_its_mode(row, name, variable):
    for few in (FEW, counts(persistent=29)):
        cause = named(replace(few, strata=(row,)))
        assert (cause.name.value, cause.variable) == (name, variable)
    # Clusters that fall apart last for nobody, however few were seen.
    for n in (10, 60):
        apart = replace(VALID, kept=replace(VALID.kept, observed=0.6, n=n), strata=(row,))
        assert named(apart).name in (CauseName.POINTWISE_NOISE, CauseName.INSUFFICIENT_SUPPORT)


def test_what_is_only_told_and_not_tested_does_not_show_that_modes_last():
    for variable in ("operator", "history", "everything_together"):
        cause = named(replace(FEW, told=(replace(TELLS, variable=variable),)))
        assert (cause.name, cause.kind) == (CauseName.INSUFFICIENT_SUPPORT, "persistence")


def test_a_disagreement_says_the_numbers_of_both():
    text = named(replace(VALID, **learned(confirmed=2, contradicted=60))).next_action
    assert "45 held-out episodes" in text and "2 show them" in text and "60 do not" in text


@pytest.mark.parametrize(
    ("confirmed", "contradicted", "name"),
    [(10, 30, "valid_modes"), (9, 30, "insufficient_support"), (9, 29, "valid_modes")],
)
def test_a_contradiction_begins_at_its_limits(confirmed, contradicted, name):
    """A quarter is enough to confirm, and thirty to contradict; the limits themselves included."""
    numbers = replace(VALID, **learned(confirmed=confirmed, contradicted=contradicted))
    limits = limit(confirmed_share=0.25, contradicted_situations=30)
    assert named(numbers, limits).name.value == name


def test_what_the_policy_sees_and_takes_for_near_is_no_contradiction():
    against = replace(VALID, **learned(confirmed=2, contradicted=60))
    seen = replace(against, strata=(replace(HIDDEN, observed=True),))
    assert (named(seen).name, named(seen).kind) == (CauseName.UNIMODAL, "observed_variable")
    unseen = replace(against, strata=(HIDDEN,))
    assert named(unseen).kind == "evidence_disagrees"


@pytest.mark.parametrize("name", ["noise_ratio", "noise_spread", "white_share"])
def test_spread_is_white_from_its_limits_on_and_by_all_three(name):
    at = {
        "noise_ratio": LIMITS["noise_ratio"], "noise_spread": LIMITS["noise_spread_m"],
        "white_share": LIMITS["white_share"],
    }  # fmt: skip
    none = {"two_mode_episodes": 0, "two_mode": 0, "persistent": 0}
    assert named(counts(**none, **at)).name is CauseName.POINTWISE_NOISE
    less = at | {name: math.nextafter(at[name], 0.0)}
    assert named(counts(**none, **less)).name is CauseName.UNIMODAL


WHITE = {"noise_ratio": 0.9, "noise_spread": 0.01, "white_share": 0.3}


@pytest.mark.parametrize(
    ("kept", "persistent", "changes", "name", "kind"),
    [
        # White spread makes noise of modes that are too short to see, and of no others.
        ({"n": 118}, 110, WHITE, "valid_modes", ""),
        ({"n": 29}, 110, WHITE, "pointwise_noise", ""),
        ({"n": 30}, 110, {}, "valid_modes", ""),
        ({"n": 118}, 30, {}, "valid_modes", ""),
        # Clusters that fall apart are noise where it could be seen, and else too little.
        ({"n": 118, "observed": 0.6}, 29, {}, "pointwise_noise", ""),
        ({"n": 118, "observed": 0.6}, 110, {}, "pointwise_noise", ""),
        ({"n": 29, "observed": 0.6}, 110, {}, "insufficient_support", "persistence"),
        ({"n": 29, "observed": 0.6}, 29, {}, "insufficient_support", "persistence"),
        ({"n": 0}, 110, {}, "insufficient_support", "persistence"),
    ],
)
def test_modes_persist_or_are_noise_or_too_short_to_tell(kept, persistent, changes, name, kind):
    numbers = counts(persistent=persistent, **changes)
    cause = named(replace(numbers, kept=replace(VALID.kept, **kept)))
    assert (cause.name.value, cause.kind) == (name, kind)


@pytest.mark.parametrize(
    ("resolved", "kind"), [(0, ""), (4, ""), (17, ""), (18, "observation_decides")]
)
def test_clusters_that_the_observation_tells_apart_are_said_to_be(resolved, kind):
    cause = named(counts(two_mode_episodes=1, two_mode=3, persistent=0, resolved=resolved))
    assert (cause.name, cause.kind) == (CauseName.UNIMODAL, kind)


@pytest.mark.parametrize(("episodes", "primary", "name"), [
    (10, 50, "valid_modes"), (9, 50, "unimodal"), (5, 20, "valid_modes"),
    (4, 20, "unimodal"),
])  # fmt: skip
def test_modes_are_shown_by_a_share_of_the_episodes_and_no_fewer_than_a_handful(
    episodes, primary, name
):
    found = named(counts(two_mode_episodes=episodes, primary_episodes=primary))
    assert found.name.value == name


def test_where_the_other_evidence_supports_its_numbers_are_held_and_the_thin_ones_shown():
    thin = replace(counts(analysed=99, analysed_episodes=19), **learned(modes=40))
    cause = named(thin)
    assert cause.name is CauseName.VALID_MODES
    held = [a for a in cause.answers if a.question == "supported_episodes" and a.limit is not None]
    assert [answer.measured for answer in held] == [50]
    assert named(replace(thin, **learned(modes=40, spoke=0.1))).kind == "neighbourhoods"


@pytest.mark.parametrize(("least", "name"), [(0, "first"), (2, "third"), (4, "last")])
def test_the_fifth_of_the_way_that_is_seen_least_is_named(least, name):
    shares = [0.9] * 5
    shares[least] = 0.6
    answers = named(replace(ABSENT, reach=reach(*shares))).answers
    (found,) = [a for a in answers if "fifth of the way" in a.what]
    assert found.measured == 0.6 and f"in the {name} fifth" in found.what


@pytest.mark.parametrize(
    ("here", "there", "name"),
    [(18, 0, "unimodal"), (19, 0, "insufficient_support"), (0, 19, "insufficient_support"),
     (0, 18, "unimodal"), (37, 0, "pointwise_noise")],
)  # fmt: skip
def test_clusters_that_fall_apart_more_often_than_chance_gives_are_not_denied(here, there, name):
    """Two ways that join a chunk later fell apart in 12 %, and the learned evidence denied them."""
    numbers = counts(two_mode_episodes=0, two_mode=0, incoherent=here)
    seen = learned(spoke=0.3)
    other = replace(seen["other"], incoherent=there)
    cause = named(replace(numbers, **seen | {"other": other}))
    assert cause.name.value == name
    assert cause.kind == ("few_clusters" if name == "insufficient_support" else "")
