"""Rollouts to watch: which ones by the rule, and that what is drawn is what the journals say."""

import re
import shutil
from html.parser import HTMLParser

import evidence
import nu_checker
import numpy as np
import pandas as pd
import pytest

from gates.evidence import Evidence
from gates.pages import clips as module
from gates.pages.clips import MOST, clips_of
from gates.pages.page import index_page
from gates.proof import judge
from gates.writing import write_gate
from genpolicy.contract.action import join_action
from genpolicy.execution.journal import JOURNAL_VERSION, Journal, encode_actions, write_journal

ROLLOUTS = "stress/rollouts.parquet"
JOURNALS = "artifacts/stress/journals"
DOWN = np.diag([1.0, -1.0, -1.0])[None]


def session(method, condition, start):
    """Forty commands to one side, with a force, an age and a fallback."""
    journal = Journal(f"{method}/{condition}/{start}", {"method": method})
    blank = dict.fromkeys(
        ("execution_horizon", "period_ns", "maximum_age_ns", "watchdog_ns", "queue_capacity",
         "replan_lead_rows", "late_chunk", "fallback_hash", "controller_mode", "checks_missing")
    )  # fmt: skip
    journal.add("session", 0, {"version": JOURNAL_VERSION, "labels": {"method": method}, **blank})
    journal.add("scene", 0, {"bodies": {}})
    journal.add("phase", 0, {"event_time_ns": 0, "old": "", "new": "approach"})
    for row in range(40):
        action = encode_actions(
            join_action(np.array([[0.4 + 0.002 * row, 0.0, 0.15]]), DOWN, 0.0)  # a closed hand
        )
        payload = {"arrival": 0, "chunk_id": "c", "row": row, "sequence": row,
                   "age_ns": 5_000_000 * row, "action": action}  # fmt: skip
        journal.add("accept", 50_000_000 * row, payload)
    journal.add("force", 1_000_000_000, {"force_n": 31.5})
    journal.add("mode", 1_500_000_000, {"old": "run", "new": "fallback"})
    journal.add("outcome", 2_000_000_000, {"outcome": "success", "mode": "left"})
    return journal


def uneven(frame):
    n = frame.reset_index(drop=True).index.to_numpy()
    success = n % 3 != 0
    return frame.assign(
        success=success,
        outcome=pd.Series(success, index=frame.index).map({True: "success", False: "timeout"}),
        mode=pd.Series(n % 2 == 0, index=frame.index).map({True: "left", False: "right"}),
        duration_s=2.0 + (7 * n % 31) / 10,
        force_peak_n=(11 * n % 17) * 1.0,
    )


@pytest.fixture(scope="module")
def built(whole, tmp_path_factory):
    """Whole evidence with uneven rollouts and a journal of each of a candidate's."""
    root = tmp_path_factory.mktemp("clips") / "repo"
    shutil.copytree(whole, root)
    evidence.edit_table(root, ROLLOUTS, uneven)
    rows = pd.read_parquet(root / "artifacts" / ROLLOUTS)
    rows = rows[rows["method"].isin(evidence.CANDIDATES)]
    for (method, condition), part in rows.groupby(["method", "perturbation"]):
        sessions = [session(method, condition, start) for start in sorted(set(part["start"]))]
        write_journal(root / JOURNALS / f"{method}__{condition}.mcap", sessions)
    evidence.record(root)
    return root


@pytest.fixture
def watched(built, tmp_path):
    module._film.cache_clear()
    shutil.copytree(built, tmp_path / "repo")
    return tmp_path / "repo"


def found(root):
    report = judge(root, "D")
    rows = pd.read_parquet(root / "artifacts" / ROLLOUTS)
    clips = clips_of({"D": report}, Evidence(root))
    return report, rows[rows["method"] == clips.method], clips


def shown_row(rows, clip):
    condition, start = re.match(r"(\w+), start (\d+):", clip.lines[0]).groups()
    (row,) = rows[(rows["perturbation"] == condition) & (rows["start"] == int(start))].to_dict(
        "records"
    )
    return row


def test_the_rule_by_hand(watched):
    report, rows, clips = found(watched)
    assert not clips.missing and clips.method in report.candidates
    said = {why.strip().capitalize(): clip for clip in clips.shown for why in clip.title.split(",")}
    won = rows[rows["success"]]
    for mode in ("left", "right"):
        own = won[won["mode"] == mode]
        counts = own.groupby("perturbation").size()
        most = min(counts[counts == counts.max()].index)
        times = sorted(own[own["perturbation"] == most]["duration_s"])
        row = shown_row(rows, said[f"Median success of mode {mode}"])
        assert row["success"] and row["mode"] == mode
        assert row["duration_s"] == times[(len(times) - 1) // 2]
    slow = shown_row(rows, said["Slowest success"])
    assert slow["success"] and slow["duration_s"] == won["duration_s"].max()
    assert shown_row(rows, said["Largest force"])["force_peak_n"] == rows["force_peak_n"].max()
    lost = rows[~rows["success"]]
    row = shown_row(rows, said[f"Timeout: median of {len(lost)}"])
    times = sorted(lost["duration_s"])
    assert not row["success"] and row["duration_s"] == times[(len(times) - 1) // 2]


def test_more_kinds_than_fit_are_named(watched):
    kinds = ("collision", "force_stop", "intervention", "timeout", "fell")

    def ended(frame):
        n = frame.reset_index(drop=True).index
        named = pd.Series([kinds[k % 5] for k in n], index=frame.index)
        return frame.assign(outcome=frame["outcome"].where(frame["success"], named))

    evidence.edit_table(watched, ROLLOUTS, ended)
    _, rows, clips = found(watched)
    lost = set(rows[~rows["success"]]["outcome"])
    assert len(clips.shown) == MOST and clips.left_out
    assert len(clips.shown) + len(clips.left_out) >= 3 + len(lost) - 2


def test_what_is_said_is_what_the_journal_and_the_row_say(watched):
    _, rows, clips = found(watched)
    for clip in clips.shown:
        row = shown_row(rows, clip)
        assert f"after {row['duration_s']:.3g} s" in clip.lines[0]
        force = row["force_peak_n"]
        assert (f"force at most {force:.3g} N" if force else "touches nothing") in clip.lines[0]
        assert clip.lines[0].endswith("oldest action 195 ms.")
        name = f"{row['method']}/{row['perturbation']}/{row['start']}"
        assert f"--session {name} " in clip.lines[1]
        assert "force, at most 31.5 N" in clip.svg and "approach" in clip.svg
        assert 'class="fallback"' in clip.svg and 'class="person"' not in clip.svg


def test_a_journal_of_another_run_is_not_shown(watched):
    report = judge(watched, "D")
    clips = clips_of({"D": report}, Evidence(watched))
    shown = clips.shown[0].lines[1].split()[2]
    condition = shown.split("__")[1].removesuffix(".mcap")
    write_journal(watched / shown, [session(clips.method, condition, 0)])
    later = clips_of({"D": report}, Evidence(watched))
    assert later.missing == f"{shown} is not the file that the report names" and not later.shown


def test_without_gate_d_and_without_journals_it_is_said(whole, judged):
    assert "not judged" in clips_of({}, Evidence(whole)).missing
    assert "is missing" in clips_of({"D": judged("D")}, Evidence(whole)).missing


class Controls(HTMLParser):
    """Radio buttons of a page by group, each with its name and whether it is chosen; scripts."""

    def __init__(self):
        super().__init__()
        self.scripts, self.inside, self.named = 0, [], []

    def handle_starttag(self, tag, attrs):
        told = dict(attrs)
        self.scripts += tag == "script" or any(name.startswith("on") for name in told)
        if tag == "label":
            self.inside.append("")
        if tag == "input":
            assert told["type"] == "radio" and "tabindex" not in told and "disabled" not in told
            self.named.append((told, told.get("aria-label", "")))

    def handle_data(self, data):
        if self.inside and self.named:
            told, name = self.named[-1]
            self.named[-1] = (told, name + data)

    def handle_endtag(self, tag):
        if tag == "label":
            self.inside.pop()

    def told(self):
        groups = {}
        for told, name in self.named:
            groups.setdefault(told["name"], []).append((name.strip(), "checked" in told))
        return groups


@nu_checker.asked
def test_the_nu_checker_says_nothing_of_a_desk_with_clips(watched, tmp_path):
    write_gate(watched, "D")
    page = index_page(watched)
    assert page.count('<div class="clip"') >= 3
    assert nu_checker.complaints({"clips": page}, tmp_path) == ""


def test_each_clip_has_named_buttons_of_its_own_and_no_script(watched):
    write_gate(watched, "D")
    page = Controls()
    text = index_page(watched)
    page.feed(text)
    groups = page.told()
    clips = sorted(name for name in groups if not name.endswith("at"))
    assert len(clips) == text.count('<div class="clip"') >= 3 and not page.scripts
    for name in clips:
        assert groups[name] == [("end", True), ("play", False), ("pause", False), ("step", False)]
        moments = groups[f"{name}at"]
        assert [f"{k / 10:.1f} s" for k in range(len(moments))] == [said for said, _ in moments]
        assert [chosen for _, chosen in moments] == [True] + [False] * (len(moments) - 1)
    assert text == index_page(watched)
