"""The database hangs on the workspace, not on the folder from which a command is given."""

import pytest

from flows.prefect_settings import home_of


@pytest.mark.parametrize(
    ("arguments", "folder"),
    [
        (["genpolicy", "resume"], "."),
        (["genpolicy", "resume", "--workspace", "run"], "run"),
        (["python", "--workspace=run", "--other"], "run"),
        (["genpolicy", "resume", "--workspace"], "."),
        (["genpolicy", "resume", "--workspace", "missing"], "."),
    ],
)
def test_prefect_lives_in_the_workspace_that_is_named(tmp_path, monkeypatch, arguments, folder):
    (tmp_path / "run").mkdir()
    monkeypatch.chdir(tmp_path)
    assert home_of(arguments) == tmp_path / folder / ".prefect"
