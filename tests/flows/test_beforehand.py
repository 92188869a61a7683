"""What a late stage would refuse is refused before the first stage of a whole ladder runs."""

from pathlib import Path

import pytest

from flows.beforehand import ASKED, refused_beforehand
from flows.ladder import run_ladder
from flows.reproduce import reproduce
from flows.workspace import make_workspace

SAYS = "params.yaml: execution.watchdog_s is 0.2."


def asked(folder: Path, code: int) -> None:
    """A workspace whose own stages say `SAYS` beforehand, and end with a code."""
    (folder / "stages").mkdir()
    (folder / "stages" / "__init__.py").touch()
    place = folder / Path(*ASKED.split(".")).with_suffix(".py")
    place.write_text(f"import sys\nprint({SAYS!r}, file=sys.stderr)\nsys.exit({code})\n")


def test_nothing_runs_but_what_is_named(checkout: Path, tmp_path: Path) -> None:
    target = make_workspace(checkout, tmp_path / "run", {})
    asked(target, 2)
    ran = target / "build" / "runs.txt"
    end = reproduce(target, echo=lambda _: None)
    assert (end.code, end.stage, end.infrastructure) == (2, "", False)
    assert end.sentence.startswith(SAYS)
    assert "genpolicy reproduce gate_a" in end.sentence
    assert not ran.exists()
    assert reproduce(target, stages=["gate_a"], echo=lambda _: None).code == 0
    assert ran.read_text().split() == ["record", "gate_a"]


@pytest.mark.parametrize("code", [0, 1, 3])
def test_any_other_end_is_left_to_the_stages(checkout: Path, tmp_path: Path, code: int) -> None:
    target = make_workspace(checkout, tmp_path / "run", {})
    asked(target, code)
    assert refused_beforehand(target) == ""
    assert reproduce(target, echo=lambda _: None).code == 0


def test_a_folder_without_a_pipeline_is_not_asked(tmp_path: Path) -> None:
    asked(tmp_path, 2)
    assert refused_beforehand(tmp_path) == ""


def test_the_flows_ask_before_a_server_runs_anything(
    checkout: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    target = make_workspace(checkout, tmp_path / "run", {})
    asked(target, 2)
    monkeypatch.setattr("flows.ladder.server_is_there", lambda: True)
    monkeypatch.setattr("flows.ladder.ladder", lambda *_, **__: pytest.fail("the ladder ran"))
    assert run_ladder(target) == 2
    assert f"The ladder stopped: {SAYS}" in capsys.readouterr().err
