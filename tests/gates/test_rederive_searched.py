"""What the card says of the failure search follows from journals and optimiser, or is refused."""

import shutil
from dataclasses import replace
from types import SimpleNamespace

import pytest
from _probed import ROOT_SEED
from _searched import EVALUATIONS, make_bench, section, write_searched

from gates import rederive
from gates import rederive_searched as module
from gates.card.searched import FAILURE_SEARCH, SEARCHED
from genpolicy.errors import BadInputError, RefusedError
from genpolicy.evidence.documents.failures import FAILURE
from genpolicy.evidence.documents.shadow import CHECKER
from genpolicy.evidence.failure_search.tables import events_sha256
from genpolicy.evidence.rows.failures import SearchedRow
from genpolicy.evidence.shadow.tables import checked
from genpolicy.execution.journal import Journal, read_journal, write_journal
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json, read_json
from genpolicy.integrity.rows import read_rows, write_rows
from genpolicy.verification.checker import check_journal

OTHER = "f" * 64


@pytest.fixture(scope="module")
def params(kit):
    changes = {
        "stress": section(kit), "seed": ROOT_SEED, "task": {"name": "tabletop_insertion"},
        "card": {"failure_search": {"evaluations": EVALUATIONS}},
    }  # fmt: skip
    return {**kit.PARAMS, **changes}


@pytest.fixture(scope="module")
def written(fleet, dataset, kit, tmp_path_factory):
    root = tmp_path_factory.mktemp("ladder")
    bench = make_bench(fleet, dataset, kit, tmp_path_factory.mktemp("made"))
    write_searched(root / FAILURE_SEARCH, bench, kit)
    shutil.copytree(fleet[0] / "flow", root / "artifacts" / "train_generators" / "flow")
    return root, bench.watched[0].sha256


@pytest.fixture
def root(written, tmp_path, monkeypatch):
    passed = SimpleNamespace(candidates={"flow": "PASS", "diffusion": "FAIL"})
    monkeypatch.setattr(module, "read_report", lambda *_: (passed, ""))
    pinned = {"flow": SimpleNamespace(checkpoint=written[1])}
    monkeypatch.setattr(module, "CANDIDATES", SimpleNamespace(read=lambda _: pinned))
    return shutil.copytree(written[0], tmp_path / "copy")


def change(root, how):
    """Write the table again with its second row changed."""
    first, row, *others = read_rows(root / SEARCHED, SearchedRow)
    write_rows(root / SEARCHED, SearchedRow, [first, *how(row), *others])


def prove(root, params):
    module.rederive_searched(root, params, rederive._held_to(params))


def plant(root, params, edit):
    """Write journals of other events, and everything else as if they had happened."""
    folder = root / FAILURE_SEARCH
    paths = sorted((folder / "journals").glob("*.mcap"))
    for path in paths:
        sessions = []
        for name, events in read_journal(path).items():
            sessions.append(Journal(name))
            for kind, time_ns, payload in edit([(e.kind, e.t, e.payload) for e in events]):
                sessions[-1].add(kind, time_ns, payload)
        write_journal(path, sessions)
        for name, events in read_journal(path).items():
            failure = folder / "failures" / f"{name}.json".replace("/", "__")
            if failure.is_file():
                stated = FAILURE.parse(read_json(failure), where=name)
                other = replace(stated, events_sha256=events_sha256(events))
                write_bytes(failure, canonical_json(FAILURE.plain(other)))
    held_to = rederive._held_to(params)
    (folder / CHECKER.file).unlink()
    found = {path.name: check_journal(path, *held_to).as_document() for path in paths}
    CHECKER.write(folder, checked(found))


def refused(root, params, match):
    with pytest.raises(RefusedError, match=match):
        prove(root, params)


def test_what_the_stage_wrote_is_proved(root, params):
    prove(root, params)


def test_nothing_written_is_nothing_to_prove(tmp_path, params):
    (tmp_path / "params.yaml").write_bytes(canonical_json(params))
    rederive.rederive(tmp_path, "E")
    (tmp_path / FAILURE_SEARCH).mkdir(parents=True)
    with pytest.raises(BadInputError, match=r"searched\.parquet"):
        rederive.rederive(tmp_path, "E")


@pytest.mark.parametrize(
    ("how", "match"),
    [
        (lambda r: [replace(r, failed=not r.failed)], "failed"),
        (lambda r: [replace(r, outcome="other")], "outcome"),
        (lambda r: [replace(r, worth=0.9)], "worth"),
        (lambda r: [replace(r, point=(0.5, *r.point[1:]))], "point"),
        (lambda r: [replace(r, point=r.point[:-1])], "point is .* which the search asks for"),
        (lambda r: [replace(r, point=())], "point is .* which the search asks for"),
        (lambda r: [replace(r, scene_start="{}")], "scene_start"),
        (lambda r: [replace(r, start_sha256="0" * 64)], "start_sha256"),
        (lambda r: [replace(r, severity=0.01)], "severity"),
        (lambda r: [], "missing"),
        (lambda r: [r, replace(r, start=7)], "without a search|only in"),
    ],
)
def test_a_changed_row_is_refused(root, params, how, match):
    change(root, how)
    refused(root, params, match)


def test_fewer_rollouts_than_planned_or_another_seed_are_refused(root, params):
    refused(
        root, {**params, "card": {"failure_search": {"evaluations": EVALUATIONS + 1}}}, "missing"
    )
    refused(root, {**params, "seed": ROOT_SEED + 1}, "point")


def test_a_failure_without_file_and_a_changed_file_are_refused(root, params):
    first, *_ = sorted((root / FAILURE_SEARCH / "failures").iterdir())
    stated = FAILURE.parse(read_json(first), where=first.name)
    for changes in ({"severity": 0.5}, {"events_sha256": "0" * 64}, {"checkpoint": "0" * 64}):
        write_bytes(first, canonical_json(FAILURE.plain(replace(stated, **changes))))
        refused(root, params, next(iter(changes)))
    first.unlink()
    refused(root, params, first.name)


def test_another_checkpoint_than_gate_b_pinned_is_refused(root, params, monkeypatch):
    pinned = {"flow": SimpleNamespace(checkpoint="0" * 64)}
    monkeypatch.setattr(module, "CANDIDATES", SimpleNamespace(read=lambda _: pinned))
    refused(root, params, "as Gate B pinned it")


def by_another_sampler(events):
    return [(k, t, p | {"sampler": OTHER} if "sampler" in p else p) for k, t, p in events]


def by_another_maker_at_the_end(events):
    time_ns = events[-1][1]
    return [*events[:-1], ("active", time_ns, {"checkpoint": OTHER, "sampler": OTHER}), events[-1]]


def by_nobody(events):
    return [event for event in events if event[0] != "active"]


@pytest.mark.parametrize(
    ("edit", "match"),
    [
        (by_another_sampler, r"flow/\w+@search/\d+: made by is"),
        (by_another_maker_at_the_end, f"made by is {OTHER}"),
        (by_nobody, "made by is nobody"),
    ],
)
def test_rollouts_that_another_maker_made_are_refused(root, params, edit, match):
    """As everywhere: weights and sampler, and whoever was in force on the way."""
    plant(root, params, edit)
    refused(root, params, match)


def test_a_journal_that_is_written_again_as_it_was_is_proved(root, params):
    plant(root, params, lambda events: events)
    prove(root, params)


def test_a_rollout_that_did_not_do_what_it_was_commanded_is_refused(root, params):
    def opened(kind, payload):
        more = {"gripper_m": payload["gripper_m"] + 0.02} if kind == "state" else {}
        return payload | more

    plant(root, params, lambda events: [(k, t, opened(k, p)) for k, t, p in events])
    refused(root, params, r"measured at 0\.000 s is gripper_m up to 0\.02 beside it")


def test_weights_that_lie_there_no_longer_are_refused(root, params):
    shutil.rmtree(root / "artifacts" / "train_generators")
    refused(root, params, "made by is")


def test_another_finding_of_the_checker_is_refused(root, params):
    folder = root / FAILURE_SEARCH
    stated = CHECKER.read(folder)
    (folder / CHECKER.file).unlink()
    CHECKER.write(folder, replace(stated, checked_actions=1))
    refused(root, params, "checked_actions")


def test_a_rollout_of_another_start_under_the_name_of_this_one_is_refused(
    root, params, monkeypatch
):
    """Its row, its point and its file fit each other; the journal began elsewhere."""
    derived = module.derived_with_recoveries

    def elsewhere(*args, **options):
        rows, recoveries = derived(*args, **options)
        return {key: {**row, "start_sha256": "0" * 64} for key, row in rows.items()}, recoveries

    monkeypatch.setattr(module, "derived_with_recoveries", elsewhere)
    monkeypatch.setattr(module, "compare_rows", lambda *args, **options: None)
    refused(root, params, "start of the journal")


def test_of_a_search_of_nothing_nothing_is_asked_of_the_starts_of_the_task(
    root, params, monkeypatch
):
    """Budget 0 is what a task is told to set whose starts cannot be chosen."""
    write_rows(root / SEARCHED, SearchedRow, [])
    none = {**params, "card": {"failure_search": {"evaluations": 0}}}
    odd = SimpleNamespace(name="odd", sample_start=lambda rng: rng.normal())
    monkeypatch.setattr(module, "load_task", lambda name: odd)
    assert module._asked_again(root, none, [], []) == []
