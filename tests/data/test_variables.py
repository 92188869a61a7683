"""What else was recorded travels with the dataset, sealed; without it no byte changes."""

import numpy as np
import pyarrow.parquet as pq
import pytest

from genpolicy.data.assemble import EPISODES_FILE, MANIFEST_FILE
from genpolicy.data.dataset import load_dataset
from genpolicy.data.variables import PREFIX, Runs, completed, runs_of, stored, varying
from genpolicy.errors import IntegrityError


def test_runs_are_what_repeats_itself_numbers_and_text():
    assert runs_of(np.array([2, 2, 5, 5, 2])) == Runs((0, 2, 4), (2.0, 5.0, 2.0))
    assert runs_of(np.array(["a", "a", "b"], dtype=object)) == Runs((0, 2), ("a", "b"))
    missing = runs_of(np.array([np.nan, np.nan, 1.0]))
    assert missing.rows == (0, 2)
    assert np.isnan(missing.values[0])


def test_what_is_the_same_everywhere_tells_nothing():
    one, other = Runs((0,), ("a",)), Runs((0,), ("b",))
    columns = {
        "same": {"1": one, "2": one},
        "differs": {"1": one, "2": other},
        "some": {"1": one},
        "switches": {"1": Runs((0, 3), (0.0, 1.0)), "2": Runs((0,), (0.0,))},
        "nothing": {"1": Runs((0,), (float("nan"),)), "2": Runs((0,), ("",))},
    }
    assert set(varying(columns, 2)) == {"differs", "some", "switches"}


@pytest.fixture
def dataset(factory, tmp_path):
    """A dataset of the factory, and where to write one again."""
    return factory.build(tmp_path / "plain"), tmp_path / "again"


def again(source, out, recorded):
    """The same dataset written once more, with what else was recorded."""
    with completed(out, recorded) as folder:
        folder.mkdir(parents=True)
        for path in source.iterdir():
            (folder / path.name).write_bytes(path.read_bytes())
    return load_dataset(out)


def test_there_and_back(dataset):
    source, out = dataset
    uuids = load_dataset(source).episodes["episode_uuid"].tolist()
    runs = {
        "hand": {uuid: Runs((0,), (f"hand {k % 2}",)) for k, uuid in enumerate(uuids)},
        "goal": {uuid: Runs((0, 4), (1.0, float(k))) for k, uuid in enumerate(uuids)},
        "some": {uuids[0]: Runs((0,), (2.5,))},
        "mixed": {uuids[0]: Runs((0,), (2.0,)), uuids[1]: Runs((0,), ("two",))},
    }
    found = stored(again(source, out, runs).episodes)
    assert set(found) == set(runs)
    for name in ("hand", "goal"):
        assert found[name] == [runs[name][uuid] for uuid in uuids]
    assert found["mixed"][:2] == [Runs((0,), ("2",)), Runs((0,), ("two",))]
    assert found["some"][0] == Runs((0,), (2.5,))
    # Not recorded is never a value.
    assert found["mixed"][2] is None
    assert found["some"][1] is None
    assert not list(out.parent.glob(".again*"))


def test_without_anything_recorded_the_bytes_are_the_same(dataset):
    source, out = dataset
    again(source, out, {})
    for path in source.iterdir():
        assert (out / path.name).read_bytes() == path.read_bytes()


def test_a_changed_value_is_refused(dataset):
    source, out = dataset
    uuids = load_dataset(source).episodes["episode_uuid"].tolist()
    again(source, out, {"hand": {u: Runs((0,), (str(k % 2),)) for k, u in enumerate(uuids)}})
    table = pq.read_table(out / EPISODES_FILE)
    place = table.column_names.index(f"{PREFIX}hand")
    changed = table.set_column(place, f"{PREFIX}hand", [["0"] * len(uuids)])
    pq.write_table(changed, out / EPISODES_FILE)
    with pytest.raises(IntegrityError, match="sha256"):
        load_dataset(out)


def test_a_failed_import_leaves_the_old_dataset(dataset):
    source, _ = dataset
    before = (source / MANIFEST_FILE).read_bytes()
    recorded = {"hand": {"x": Runs((0,), ("left",))}}
    with pytest.raises(RuntimeError), completed(source, recorded):
        raise RuntimeError("refused")
    assert (source / MANIFEST_FILE).read_bytes() == before
