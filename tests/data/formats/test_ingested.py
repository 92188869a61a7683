"""Datasets that were ingested before are used as they are."""

import json

from genpolicy.data.formats import open_dataset


def test_a_dataset_is_used_as_it_is_and_brings_its_contract(layouts, tmp_path):
    first = open_dataset(layouts.v2(tmp_path / "a"), out=tmp_path / "out")
    again = open_dataset(tmp_path / "out", out=tmp_path / "other")
    assert again.folder == tmp_path / "out"
    assert again.contract == first.contract
    assert (again.found, again.accepted, again.notes) == (6, 6, first.notes)
    assert not (tmp_path / "other").exists()


def test_a_dataset_of_the_ladder_implies_its_contract(factory, tmp_path):
    folder = factory.build(tmp_path)
    assert "import_contract" not in json.loads((folder / "manifest.json").read_text())
    opened = open_dataset(folder, out=tmp_path / "other")
    assert opened.contract.format == "dataset"
    assert (opened.contract.pairing or {})["tcp_y_m"] == "tcp_position_m.y"
    assert opened.contract.labels.phase is None  # a policy of this dataset sees the phase
