"""The soak in parts: nothing is done twice, other code counts nothing, a wrong ends it."""

import json

import pytest

from benchmarks.soak import KINDS, LEFT, ROOT, Part, code_of, go_on, main, said

LIKE = Part("events", "code", 7, 0, 0, 0)


class Player:
    """Parts of ten events and four commands; some of them wrong."""

    def __init__(self, wrong=()):
        self.asked, self.wrong = [], wrong

    def __call__(self, number):
        self.asked.append(number)
        return 10, 4, ["too fast"] if number in self.wrong else []


def test_a_run_that_was_cut_goes_on_and_adds_up(tmp_path):
    out, first, second = tmp_path / "soak.jsonl", Player(), Player()
    time_left = iter([True, True, False])
    assert len(go_on(first, LIKE, wanted=50, out=out, more=lambda: next(time_left))) == 2
    whole = go_on(second, LIKE, wanted=50, out=out)
    assert (first.asked, second.asked) == ([0, 1], [2, 3, 4])
    assert sum(part.done for part in whole) == 50 and sum(part.at_risk for part in whole) == 20
    third = Player()
    assert go_on(third, LIKE, wanted=50, out=out) and third.asked == []


@pytest.mark.parametrize("other", [{"code": "another"}, {"seed": 8}, {"kind": "chunks"}])
def test_what_other_code_or_another_seed_left_counts_nothing(other, tmp_path):
    out, again = tmp_path / "soak.jsonl", Player()
    go_on(Player(), Part(**{**vars(LIKE), **other}), wanted=30, out=out)
    assert len(go_on(again, LIKE, wanted=30, out=out)) == 3 and again.asked == [0, 1, 2]


def test_a_wrong_ends_it_and_is_not_forgotten(tmp_path):
    out, player, again = tmp_path / "soak.jsonl", Player(wrong=(1,)), Player()
    parts = go_on(player, LIKE, wanted=90, out=out)
    assert player.asked == [0, 1]
    assert said("events", parts).splitlines()[1:] == ["part 1: too fast"]
    assert go_on(again, LIKE, wanted=90, out=out) == parts and again.asked == []


def test_the_bound_is_exact_and_of_all_parts():
    parts = [Part("events", "code", 7, number, 10, 150, []) for number in range(2)]
    # The rule of three of a two-sided interval: 1 - 0.025 ** (1 / 300) = 0.0122.
    assert said("events", parts) == (
        "20 events in 2 parts, 300 commands, 0 wrong; at most 0.012 of the commands (95 %)"
    )


@pytest.mark.parametrize(
    ("wrongs", "wanted", "code"), [([], 10, 0), ([], 20, LEFT), (["x"], 10, 1)]
)
def test_the_command_says_how_it_ended(tmp_path, monkeypatch, capsys, wrongs, wanted, code):
    out = tmp_path / "soak.jsonl"
    done = Part("events", code_of(KINDS["events"][0]), 0, 0, 10, 4, wrongs)
    out.write_text(json.dumps(vars(done)) + "\n")
    asked = ["soak", "events", "--wanted", str(wanted), "--minutes", "0", "--out", str(out)]
    monkeypatch.setattr("sys.argv", asked)
    assert main() == code and "10 events in 1 parts" in capsys.readouterr().out


def test_the_code_of_a_part_is_the_library_and_its_script():
    codes = {code_of(script) for script, *_ in KINDS.values()}
    assert len(codes) == 2 and all((ROOT / script).is_file() for script, *_ in KINDS.values())
