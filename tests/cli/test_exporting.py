"""`genpolicy export lerobot`: what it prints, what it does not write over."""

from genpolicy.cli.main import main


def run(*words):
    return main(["export", "lerobot", *map(str, words)])


def test_it_says_what_it_wrote_and_replaces_its_own(dataset, tmp_path, capsys):
    out = tmp_path / "out"
    for _ in range(2):
        assert run(dataset, "--out", out) == 0
        lines = capsys.readouterr().out.splitlines()
        assert lines[0] == f"dataset   {out}"
        assert lines[1].startswith("split     train;")
        assert lines[2].endswith("(0 that did not succeed are left out)")
        assert "feature   observation.state (10)" in lines
    assert (out / "meta" / "info.json").is_file()


def test_what_somebody_else_wrote_stays(dataset, tmp_path, capsys):
    (tmp_path / "precious").mkdir()
    (tmp_path / "precious" / "thesis.txt").write_text("mine")
    assert run(dataset, "--out", tmp_path / "precious") == 2
    assert "which holds something that is no export" in capsys.readouterr().err
    assert (tmp_path / "precious" / "thesis.txt").read_text() == "mine"


def test_the_dataset_itself_is_no_place_for_it(dataset, tmp_path, capsys):
    assert run(dataset, "--out", dataset) == 2
    assert (dataset / "manifest.json").is_file()
    assert run(dataset, "--out", dataset / "lerobot") == 2
    assert "inside the dataset" in capsys.readouterr().err
    assert run(tmp_path / "none", "--out", tmp_path / "out") == 2
    assert "manifest.json is not readable" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
