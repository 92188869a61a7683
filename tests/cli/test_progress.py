"""How far a command is: few lines in a log."""

from genpolicy.cli.progress import ProgressLine


def test_progress_prints_few_lines_in_a_log(capsys):
    now = [0.0]
    line = ProgressLine("episodes", clock=lambda: now[0])
    for done in range(1, 101):
        now[0] += 0.5
        line(done, 100)
    line.close()
    printed = capsys.readouterr().err.splitlines()
    assert 3 <= len(printed) <= 6
    assert printed[0] == "episodes: 20 of 100"
