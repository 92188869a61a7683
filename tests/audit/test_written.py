"""One recording, written as people write it: one verdict for every form and every name."""

import numpy as np
import pytest
from planar import named, planar
from written import audited_table, forms, write

from genpolicy.audit import learned
from genpolicy.audit.data import canonical

SETTINGS = {"chunk_rows": 16, "persistence_lag_rows": 16, "query_stride": 3, "resamples": 20}
# A defect of the data needs no situations.
FEW = {**SETTINGS, "query_stride": 20}
UNNAMED, LIKE_THE_STATE = ("action_0", "action_1"), ("action_x", "action_y")


@pytest.fixture(autouse=True)
def _few_learned(monkeypatch):
    """A sixth of the situations that are asked by what predicts the action: half of the time."""
    monkeypatch.setattr(learned, "QUERIES", 100)


@pytest.fixture(scope="module")
def free():
    """Two routes, chosen freely, and the verdict on them as places."""
    return canonical(planar(episodes=90)[0])


@pytest.fixture(scope="module")
def one_way():
    """The same task with one route."""
    return canonical(planar(episodes=90, modes="none")[0])


def audited(data, action, folder, settings=SETTINGS, **layout):
    opened, report = audited_table(
        write(folder / "table.parquet", data, action, **layout), folder, **settings
    )
    return opened.contract, report, named(report.result, report.settings)


@pytest.mark.parametrize(
    "form",
    ["absolute", "from_observed", "delta", "velocity", "normalised_delta", "normalised_place"],
)
def test_two_routes_are_two_modes_in_every_form(free, tmp_path, form):
    contract, report, cause = audited(free, forms(free)[form], tmp_path, names=UNNAMED)
    assert contract.pairing == {"action_0": "state_m.x", "action_1": "state_m.y"}
    assert (cause.name, cause.variable) == ("valid_modes", "")
    assert len(report.modes) == 2
    # Not one situation more or less than in the form of places, which has 44.
    assert report.result.counts.two_mode == 44
    assert not report.result.semantics.findings
    if form != "absolute":
        assert any("What the action means was found" in line for line in report.rests_on)


@pytest.mark.parametrize("form", ["absolute", "velocity"])
def test_one_route_is_one_mode_in_every_form(one_way, tmp_path, form):
    _, report, cause = audited(one_way, forms(one_way)[form], tmp_path, names=LIKE_THE_STATE)
    assert (cause.name, cause.kind) == ("unimodal", "")
    assert not report.result.semantics.findings


def spoiled(data, share, change, seed):
    """An action with `change` in a share of the episodes."""
    bad = np.random.default_rng(seed).permutation(len(data.episodes)) < share * len(data.episodes)
    rows = bad[data.episode]

    def of(action):
        action = action.copy()
        action[rows] = change(action[rows])
        return action

    return of


@pytest.mark.parametrize(
    ("form", "names"), [("absolute", UNNAMED), ("delta", UNNAMED), ("delta", LIKE_THE_STATE)]
)
@pytest.mark.parametrize(
    ("share", "change", "kind"),
    [
        (0.25, lambda a: a[:, ::-1], "swapped_columns"),
        (0.30, lambda a: a * np.array([1.0, -1.0]), "frame"),
    ],
)
def test_a_fault_in_some_episodes_is_found_and_not_absorbed(
    free, tmp_path, form, names, share, change, kind
):
    action = spoiled(free, share, change, 1)(forms(free)[form])
    contract, _, cause = audited(free, action, tmp_path, FEW, names=names)
    assert sorted((contract.pairing or {}).values()) == ["state_m.x", "state_m.y"]
    assert (cause.name, cause.kind) == ("data_defect", kind)


@pytest.mark.parametrize("form", ["absolute", "delta"])
def test_columns_swapped_everywhere_are_a_defect_under_names_only(free, tmp_path, form):
    swapped = forms(free)[form][:, ::-1]
    _, report, cause = audited(free, swapped, tmp_path, FEW, names=LIKE_THE_STATE)
    assert (cause.name, cause.kind) == ("data_defect", "swapped_columns")
    assert any("Names and numbers contradict" in line for line in report.rests_on)
    contract, report, cause = audited(free, swapped, tmp_path, FEW, names=UNNAMED)
    assert contract.pairing == {"action_0": "state_m.y", "action_1": "state_m.x"}
    assert cause.name != "data_defect" and not report.result.semantics.findings


@pytest.mark.parametrize("form", ["absolute", "velocity"])
def test_a_shared_hand_and_a_held_height_change_no_verdict(free, tmp_path, form):
    """Names of the hand alone are shared; a height that is held has no scale to compare."""
    closed = (free.index > 30).astype(float)
    noise = np.random.default_rng(0).normal(0, 1e-4, len(closed))
    extra = {
        "state_gripper": np.where(free.index > 31, 1.0, 0.0), "action_gripper": closed,
        "state_z": 0.2 + noise, "action_z": np.full(len(closed), 0.2),
    }  # fmt: skip
    contract, report, cause = audited(
        free, forms(free)[form], tmp_path, names=("action_p", "action_q"), extra=extra
    )
    assert dict(contract.pairing or {}) == {
        "action_p": "state_m.x", "action_q": "state_m.y", "action_gripper": "state.gripper",
    }  # fmt: skip
    assert report.settings.action_components == ["action_p", "action_q"]
    assert contract.forms["action_gripper"].form == "place"
    assert cause.name == "valid_modes"
    assert not report.result.semantics.findings
