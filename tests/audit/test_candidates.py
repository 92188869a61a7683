"""What of the recorded columns can be a reason, what it is called, and what cannot."""

from dataclasses import replace

import numpy as np
import pytest
from planar import planar, shuffled
from planar_dataset import dataset_of

from genpolicy.audit.candidates import COUNTED, EVERY_EPISODE, SAME_AS_OUTCOME, candidates
from genpolicy.audit.data import canonical

N = 40


@pytest.fixture(scope="module")
def data():
    plain = canonical(planar(episodes=N)[0])
    blank = np.full(N, "")
    return replace(plain, episodes=replace(plain.episodes, operator=blank, object=blank))


def found(data, manifest=None, **columns):
    """Candidates of the data with columns added, one value an episode."""
    table = dataset_of(data).episodes.drop(columns=["operator", "object"])
    for name, values in columns.items():
        table[name] = values
    return candidates(table, manifest or {}, data)


def names(result):
    return sorted(item.name for item in result.variables)


def kind(k):
    return k % 3


@pytest.mark.parametrize(
    "values",
    [[f"kitchen {kind(k)}" for k in range(N)], [kind(k) for k in range(N)],
     [float(kind(k)) / 7 for k in range(N)], [str(kind(k)) for k in range(N)]],
    ids=["text", "whole", "fractions", "numbers as text"],
)  # fmt: skip
@pytest.mark.parametrize("name", ["scenario", "latent", "q7_Ω", "left", "hand side"])
def test_groups_under_any_name(data, name, values):
    result = found(data, **{f"variable.{name}": [str(v) for v in values]})
    assert names(result) == [name]
    (item,) = result.variables
    assert not item.is_measure
    assert item.values.max() == 2
    assert item.key == found(data, **{"variable.other": [str(v) for v in values]}).variables[0].key


@pytest.mark.parametrize(
    ("name", "values", "first"),
    [("temperature", [20 + k / 7 for k in range(N)], 20.0),
     ("time_of_day", [f"{8 + k // 6:02d}:{k % 6}5" for k in range(N)], 8 * 3600 + 300),
     ("recorded_at", [f"2024-03-{1 + k % 20:02d}T08:00:{k:02d}" for k in range(N)], None),
     ("started_s", [36000.0 + 97 * k for k in range(N)], 36000.0)],
)  # fmt: skip
def test_measures(data, name, values, first):
    (item,) = found(data, **{f"variable.{name}": values}).variables
    assert item.is_measure
    assert len(np.unique(item.values)) == N
    if first is not None:
        assert item.values.min() == pytest.approx(first)


def test_dates_are_asked_by_their_time_of_day_too(data):
    # Mornings one way and evenings the other, over a month: the date tells nothing of it.
    hours = [8 + k % 2 * 9 for k in range(N)]
    texts = [
        f"2024-03-{1 + (k * 7) % 28:02d}T{hour:02d}:{k:02d}:00" for k, hour in enumerate(hours)
    ]
    texts[4] = None
    by_name = {item.name: item for item in found(data, **{"variable.made": texts}).variables}
    day = by_name["made (time of day)"]
    assert day.is_measure and np.isnan(day.values[4]) and len(by_name) == 2
    assert day.values[5] == 17 * 3600 + 5 * 60


@pytest.mark.parametrize(
    "values",
    [[f"2024-03-{1 + k % 20:02d}" for k in range(N)],
     [f"2024-03-01T{8 + k % 9:02d}:{k:02d}:00" for k in range(N)],
     [f"2024-03-{1 + k % 20:02d}T08:00:{k:02d}" for k in range(N)],
     [f"2024-03-{1 + k % 20:02d}T{k % 24:02d}:00:00" if k else "later" for k in range(N)],
     [40000.0 * k for k in range(N)]],
    ids=["no times", "one day", "within an hour", "one is no date", "numbers"],
)  # fmt: skip
def test_what_has_no_time_of_day_is_asked_by_none(data, values):
    assert not any("time of day" in name for name in names(found(data, **{"variable.a": values})))


def test_text_that_names_every_episode_is_asked_by_its_words(data):
    texts = [f"{k:03d}: go {('left', 'right')[k % 2]}" for k in range(N)]
    result = found(data, **{"variable.note": texts})
    assert (names(result), result.left_out) == (['note ("left")'], (("note", EVERY_EPISODE),))


def test_the_task_is_called_as_the_recordings_call_it(data):
    manifest = {"import_contract": {"labels": {"task": "instruction"}}}
    assert names(found(data, manifest, task=[f"go {kind(k)}" for k in range(N)])) == ["instruction"]


@pytest.mark.parametrize(
    ("name", "values", "why"),
    [("uuid", [f"{k:08x}-x" for k in range(N)], EVERY_EPISODE),
     ("note", [f"take {k // 2}" if k < 8 else f"take {k}" for k in range(N)], EVERY_EPISODE),
     ("seed", [str(977 * k % 1009) for k in range(N)], COUNTED),
     ("take", [float(k) for k in range(100, 100 + N)], COUNTED)],
)  # fmt: skip
def test_what_names_the_episodes_is_no_group(data, name, values, why):
    result = found(data, **{f"variable.{name}": values})
    assert (names(result), result.left_out) == ([], ((name, why),))


def test_the_same_everywhere_and_missing_everywhere_is_nothing(data):
    result = found(
        data, **{"variable.a": ["one"] * N, "variable.b": [""] * N, "task": ["reach"] * N}
    )
    assert (names(result), result.left_out) == ([], ())


def test_one_collection_lacks_a_column(data):
    values = [f"v{k % 2}" if k % 4 else None for k in range(N)]
    (item,) = found(data, **{"variable.scenario": values}).variables
    assert item.values.max() == 2
    measure = [k / 7 if k % 4 else None for k in range(N)]
    (item,) = found(data, **{"variable.temperature": measure}).variables
    assert np.count_nonzero(np.isnan(item.values)) == N // 4


def test_what_says_the_same_is_one_question_under_the_best_name(data):
    columns = {
        "task": [f"go {kind(k)}" for k in range(N)],
        "variable.task_index": [str(5 - kind(k)) for k in range(N)],
        "source_file": [f"{kind(k)}/b.parquet#demo_{k}" for k in range(N)],
        "variable.tool": [f"t{k % 4}" for k in range(N)],
        "variable.kelvin": [273 + k / 7 for k in range(N)],
        "variable.celsius": [k / 7 for k in range(N)],
        "variable.cold": [9 - k / 7 for k in range(N)],
        "variable.weight": [(k * 7) % N + 0.5 for k in range(N)],
    }
    result = found(data, **columns)
    assert names(result) == ["cold", "task", "tool", "weight"]
    also = {item.name: item.also for item in result.variables}
    assert also["task"] == ("task_index", "file", "folder")
    assert also["cold"] == ("kelvin", "celsius")


def test_many_tasks_and_their_numbers_are_one_question(data):
    columns = {
        "task": [f"go {k % 17}" for k in range(N)],
        "variable.task_index": [float(k % 17) for k in range(N)],
    }
    (item,) = found(data, **columns).variables
    assert (item.name, item.also, item.is_measure) == ("task", ("task_index",), False)


def test_what_a_label_or_the_outcome_says_is_not_asked_twice(data):
    labelled = replace(
        data, episodes=replace(data.episodes, operator=np.array([f"op{k % 2}" for k in range(N)]))
    )
    order = {str(uuid): k for k, uuid in enumerate(labelled.episodes.uuid)}
    table_order = [order[str(u)] for u in dataset_of(labelled).episodes["episode_uuid"]]
    collector = [f"c{k % 2}" for k in table_order]
    outcome = [str(v == "success") for v in labelled.episodes.outcome[table_order]]
    result = found(labelled, **{"variable.collector": collector, "variable.good": outcome})
    assert names(result) == []
    varied = len(set(outcome)) > 1
    assert result.left_out == ((("good", SAME_AS_OUTCOME),) if varied else ())


@pytest.mark.parametrize(
    ("name", "called"),
    [("history", "history (column)"), ("episode_order", "episode_order (column)"),
     ("mode_of_reach", "mode_of_reach (column)"), ("operator", "operator"),
     ("x", "x (column)")],
)  # fmt: skip
def test_a_column_is_told_apart_from_what_the_audit_calls_so(data, name, called):
    assert names(found(data, **{f"variable.{name}": [f"v{k % 2}" for k in range(N)]})) == [called]


def test_values_that_switch_inside_episodes_are_values_by_row(data):
    runs = [[{"row": 0, "value": f"g{k % 2}"}, {"row": 5, "value": f"g{k % 3}"}] for k in range(N)]
    (item,) = found(data, **{"variable.goal": runs}).variables
    assert item.by_row
    assert len(item.values) == len(data.observation)
    order = {str(uuid): k for k, uuid in enumerate(dataset_of(data).episodes["episode_uuid"])}
    place = order[str(data.episodes.uuid[7])]
    part = item.values[data.episode == 7]
    assert len(np.unique(part[:5])) == len(np.unique(part[5:])) == 1
    assert (part[0] == part[5]) == (place % 2 == place % 3)


def test_a_column_of_the_phase_gives_it_its_name(data):
    hidden = replace(data, phase_observed=False)
    starts = np.searchsorted(hidden.episode, np.arange(N))
    runs = []
    for k in range(N):
        phase = hidden.phase[hidden.episode == k]
        switches = [0, *(np.flatnonzero(phase[1:] != phase[:-1]) + 1).tolist()]
        runs.append([{"row": s, "value": f"skill {phase[s]}"} for s in switches])
    assert len(starts) == N
    result = found(hidden, **{"variable.skill": runs})
    assert (names(result), result.phase_name) == ([], "phase")
    contract = {"import_contract": {"labels": {"phase": "subtask"}}}
    assert found(hidden, contract).phase_name == "subtask"


def test_the_order_of_episodes_changes_nothing(data):
    columns = {"variable.tool": "t", "variable.heat": None}
    by_uuid = {str(u): k for k, u in enumerate(data.episodes.uuid)}

    def of(some):
        table = dataset_of(some).episodes.drop(columns=["operator", "object"])
        place = [by_uuid[str(u)] for u in table["episode_uuid"]]
        table["variable.tool"] = [f"t{k % 3}" for k in place]
        table["variable.heat"] = [np.sin(k) for k in place]
        return candidates(table, {}, canonical(some)).variables

    one, other = of(data), of(shuffled(data, 3))
    assert len(one) == len(columns)
    for a, b in zip(one, other, strict=True):
        assert (a.name, a.key) == (b.name, b.key)


@pytest.mark.parametrize(("source", "expected"), [("parquet", ["file"]), ("lerobot", [])])
def test_the_file_is_a_reason_where_files_are_no_order(data, source, expected):
    files = [f"{k % 2}.parquet#episode_{k}" for k in range(N)]
    assert names(found(data, {"source_kind": source}, source_file=files)) == expected
    one_each = [f"day/{k}.parquet" for k in range(N)]
    assert found(data, {"source_kind": source}, source_file=one_each).left_out == ()


def test_what_a_file_is_called_beside_its_number_is_a_reason(data):
    files = [f"day_{k % 3}/{'ada' if k % 4 else 'ben'}_{k:03d}.parquet#0" for k in range(N)]
    result = found(data, {"source_kind": "parquet"}, source_file=files)
    assert names(result) == ["file name", "folder"] and result.left_out == ()
    whose = {"variable.collector": ["ada" if k % 4 else "ben" for k in range(N)]}
    result = found(data, {"source_kind": "parquet"}, source_file=files, **whose)
    assert names(result) == ["collector", "folder"]
