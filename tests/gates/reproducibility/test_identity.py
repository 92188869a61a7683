"""The identity card: what nobody recorded, and what the checkpoint says otherwise, is named."""

import dataclasses
import json

import evidence
import pandas as pd
import pytest
from asked import asked

from gates.evidence import Evidence
from gates.pages.page import gate_page, identities
from gates.proof import judge
from gates.reproducibility.gate import unpinned_items
from gates.reproducibility.identity import MAY_BE_NONE
from genpolicy.evidence.documents.reproducibility import IdentityCard

IDENTITY = "reload/identity.json"
ITEMS = {item.name: item for item in dataclasses.fields(IdentityCard)}


def say(root, name, value):
    evidence.edit_document(root, IDENTITY, lambda d: d["flow"]["card"].__setitem__(name, value))


def unpinned(root):
    return asked(root, unpinned_items, "flow", gate="B")


def nothing(value):
    return [] if isinstance(value, list) else type(value)()


def test_what_nobody_recorded_fails_by_name(ladder):
    assert unpinned(ladder).value == 0
    card = json.loads((ladder / "artifacts" / IDENTITY).read_text())["flow"]["card"]
    for name in sorted(set(ITEMS) - set(MAY_BE_NONE)):
        say(ladder, name, nothing(card[name]))
        found = unpinned(ladder)
        assert found.value >= 1 and name in found.caveat, name
        say(ladder, name, card[name])
    assert unpinned(ladder).value == 0


@pytest.mark.parametrize(("sampler", "item"), [("ddim", "eta"), ("bosh3", "tolerance")])
def test_a_sampler_that_is_another_one_without_it_needs_it(ladder, sampler, item):
    evidence.edit_document(
        ladder, "train_generators/matched.json",
        lambda d: d["methods"]["flow"]["config"]["sampler"].__setitem__("name", sampler),
    )  # fmt: skip
    say(ladder, "sampler", sampler)
    found = unpinned(ladder)
    assert found.value == 1 and found.caveat == item
    config = json.loads((ladder / "artifacts/train_generators/matched.json").read_text())
    trained = config["methods"]["flow"]["config"]["sampler"][item]
    say(ladder, item, trained)
    assert unpinned(ladder).value == 0
    say(ladder, item, trained + 0.5)
    assert unpinned(ladder).caveat == f"{item}: {trained + 0.5}, trained as {trained}"


@pytest.mark.parametrize(
    ("item", "value"),
    [("parameters", 99), ("training_seeds", ["1"]), ("dataset", "e" * 64),
     ("action_semantics", "e" * 64), ("observation_semantics", "e" * 64),
     ("observation_horizon", 3), ("prediction_horizon", 17), ("execution_horizon", 9),
     ("control_rate_hz", 10.0), ("split", "e" * 64),
     ("evaluations", "4"), ("sampler", "heun"), ("sampler_steps", 2), ("batch_rows", 8)],
)  # fmt: skip
def test_what_the_checkpoint_says_otherwise_is_named_with_both(ladder, item, value):
    say(ladder, item, value)
    found = unpinned(ladder)
    # What the file of weights says is said beside what the configuration says, and the rate of
    # invocations follows from two others.
    twice = ("parameters", "control_rate_hz", "execution_horizon")
    assert found.value == (2 if item in twice else 1)
    assert found.caveat.startswith(f"{item}: {value}, trained as ")


def trained_twice(root):
    """`flow` has a second training, and every table has its rows."""
    folder = root / "artifacts/train_generators/flow/seed_1"
    folder.mkdir()
    (folder / "model.safetensors").write_bytes(evidence.weights("again"))
    (folder / "config.json").write_bytes(b"{}")
    for table in ("samples", "variations", "compute", "nfe", "modes", "modes_earlier"):
        evidence.edit_table(
            root, f"reload/{table}.parquet",
            lambda f: pd.concat([f, f[f["method"] == "flow"].assign(seed=1)], ignore_index=True),
        )  # fmt: skip
    evidence.edit_document(root, IDENTITY, two)
    evidence.follow(root)


def two(document, seeds=(0, 7), said=("0", "7")):
    document["flow"]["seed"] = list(seeds)
    document["flow"]["card"]["training_seeds"] = list(said)


def test_several_training_seeds_are_all_on_the_card(ladder):
    """`matched.json` holds the configuration of the first, which is the one that is promoted."""
    trained_twice(ladder)
    assert unpinned(ladder).value == 0
    evidence.edit_document(ladder, IDENTITY, lambda d: two(d, said=("0",)))
    assert "training_seeds" in unpinned(ladder).caveat
    evidence.edit_document(ladder, IDENTITY, lambda d: two(d, seeds=(7, 0), said=("7", "0")))
    assert unpinned(ladder).caveat == "seed: [7, 0], trained as 0 first"
    evidence.edit_document(ladder, IDENTITY, lambda d: two(d, seeds=(0, 8), said=("0", "8")))
    assert unpinned(ladder).caveat == "seed: 0, 8; its trainings have 0, 7"


@pytest.mark.parametrize(
    ("tables", "name"),
    [(("samples", "variations", "compute"), "samples"), (("nfe",), "evaluations"),
     (("modes",), "modes")],
)  # fmt: skip
def test_a_training_of_which_a_table_has_no_rows_is_not_left_out(ladder, tables, name):
    """Whoever shows the best of two trainings has selected it."""
    trained_twice(ladder)
    for table in tables:
        evidence.edit_table(ladder, f"reload/{table}.parquet", lambda f: f[f["seed"] == 0])
    found = unpinned(ladder)
    assert found.value == 1 and found.caveat == f"seed: {name} are of 0, trained were 0, 1"


def test_a_training_that_lies_there_and_is_not_on_the_card_is_named(ladder):
    folder = ladder / "artifacts/train_generators/flow/seed_1"
    folder.mkdir()
    first = folder.parent / "seed_0/config.json"
    (folder / "model.safetensors").write_bytes(evidence.weights("the other one"))
    (folder / "config.json").write_bytes(first.read_bytes())
    found = unpinned(ladder)
    assert "checkpoint: not the files of its trainings" in found.caveat
    assert "seed: modes are of 0, trained were 0, 1" in found.caveat


@pytest.mark.parametrize(
    ("change", "said"),
    [({"checkpoint": "e" * 64}, "checkpoint: not the files"),
     ({"checkpoint": "e" * 64, "checkpoints": ["e" * 64]}, "checkpoint: not the files"),
     ({"config": ["e" * 64]}, "config: not the files"),
     ({"checkpoint": " "}, "checkpoint"), ({"config": [" "]}, "config"),
     ({"sampler": " "}, "sampler")],
)  # fmt: skip
def test_a_pin_that_is_no_file_of_the_candidate_pins_nothing(ladder, change, said):
    evidence.edit_document(ladder, IDENTITY, lambda d: d["flow"].update(change))
    found = unpinned(ladder)
    assert found.value >= 1 and found.caveat.startswith(said)


@pytest.mark.parametrize(
    ("item", "value"),
    [("selector", "  "), ("path", "\n"), ("selector_sha256", " "), ("selector_sha256", "none"),
     ("deadline_s", -1.0), ("training_seeds", [" "])],
)  # fmt: skip
def test_an_item_that_is_blank_or_no_quantity_is_not_recorded(ladder, item, value):
    say(ladder, item, value)
    found = unpinned(ladder)
    assert found.value >= 1 and item in found.caveat


def test_a_card_without_an_item_is_missing_evidence(ladder):
    evidence.edit_document(ladder, IDENTITY, lambda d: d["flow"]["card"].pop("selector") and None)
    report = judge(ladder, "B")
    assert report.verdict == "INCONCLUSIVE"
    found = [c.caveat for c in report.criteria if c.id == "unpinned_items"]
    assert found and all("selector" in caveat for caveat in found), found


def test_the_page_sets_side_by_side_what_differs_and_says_once_what_does_not(ladder):
    say(ladder, "path", "a path of its own")
    report = judge(ladder, "B")
    found = identities(Evidence(ladder), report)
    heads, *rows = found.differ
    assert set(heads) == {"", *evidence.CANDIDATES}
    checkpoint, row = rows
    assert checkpoint[0] == "checkpoint" and all(said.endswith("…") for said in checkpoint[1:])
    assert row[0] == "path" and row[heads.index("flow")] == "a path of its own"
    shared = dict(found.shared)
    assert shared["control rate, Hz"] == "20" and shared["deadline, s"] == "0.15"
    assert shared["eta"] == "none: the sampler has none" and len(shared) == len(ITEMS) - 1
    page = gate_page(ladder, report)
    assert "Who is judged" in page and f"The same for all: {len(shared)} items" in page
    assert identities(Evidence(ladder), judge(ladder, "A")) is None


def test_without_a_document_the_page_stands_without_cards(ladder):
    evidence.replace(ladder, IDENTITY, None)
    page = gate_page(ladder, judge(ladder, "B"))
    assert "Who is judged" not in page
