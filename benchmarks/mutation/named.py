"""Wrongs that tests once did not notice, written down by hand: each must turn a test red.

A sample by a tool says how often tests notice; this list says that these are noticed. Each row is
one change of one text, found exactly once in its module.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from benchmarks.mutation.plan import ROOT, tests_of
from benchmarks.mutation.runner import KILLED, outcome, require_green, warm_up


@dataclass(frozen=True)
class Named:
    """One wrong.

    Attributes:
        wrong: What the module does with it.
        path: The module.
        true: Text as it stands, once.
        changed: Text in its place.
    """

    wrong: str
    path: str
    true: str
    changed: str

    @property
    def text(self) -> str:
        """The module's text with the wrong in it.

        Raises:
            ValueError: The true text is not there, or not once.
        """
        whole = (ROOT / self.path).read_text()
        if whole.count(self.true) != 1:
            raise ValueError(f"{self.path}: {self.true!r} {whole.count(self.true)} times, not once")
        return whole.replace(self.true, self.changed)


PEOPLE, SIGNING, CARD = "gates/card/people.py", "gates/card/signing.py", "gates/card/card.py"
JUDGE, TRIAL, ROLLOUTS = "gates/card/judge.py", "gates/stress/trial.py", "gates/stress/rollouts.py"
ITSELF = "gates/stress/itself.py"
BOUNDS, VERDICTS = "gates/bounds.py", "gates/verdicts.py"
PAPERS = "gates/card/papers.py"
STUB, QUEUE = "genpolicy/execution/stub.py", "genpolicy/execution/chunk_queue.py"
CHECKS = "genpolicy/execution/checks.py"
ARRIVAL, EXECUTOR = "genpolicy/execution/arrival.py", "genpolicy/execution/executor.py"
NAMED = (
    Named("the reviewer may be an author", PEOPLE, "if reviewer in authors:", "if False:"),
    Named("an author may sign as owner", PEOPLE,
          "person.id in authors or person.role == AUTHOR", "person.role == AUTHOR"),
    Named("whose role is author may sign", PEOPLE,
          "person.id in authors or person.role == AUTHOR", "person.id in authors"),
    Named("an author whom nobody knows", PEOPLE, "    if unknown:", "    if False:"),
    Named("a card without authors is independent", PEOPLE, "if not authors:", "if False:"),
    Named("one key under two names", PEOPLE,
          '        ("public_key", [person.public_key for person in found.people]),\n', ""),
    Named("the named reviewer need not sign", SIGNING,
          "if card.reviewer not in names:", "if False:"),
    Named("dependence is not asked when judged", SIGNING,
          "why = dependence(card.reviewer, card.authors, signed.signers, allowed)", 'why = ""'),
    Named("dependence is not asked when signed", SIGNING,
          "card.reviewer, card.authors, [person], allowed)\n    if why:",
          "card.reviewer, card.authors, [person], allowed)\n    if False:"),
    Named("signatures are not verified", SIGNING,
          "envelope.verify([person.key for person in signers], len(signers))", "pass"),
    Named("a key that is on no list", SIGNING, "    if unknown:", "    if False:"),
    Named("a payload of another chain", SIGNING,
          "if payload != statement(root, card):", "if False:"),
    Named("nobody compares with the draft", SIGNING,
          "if getattr(card, name) != getattr(draft, name):", "if False:"),
    Named("caveats may be left out when signed", SIGNING, "    if lacking:", "    if False:"),
    Named("an incomplete card is signed", SIGNING, "    if missing:", "    if False:"),
    Named("a rehearsal is signed", SIGNING,
          "if is_rehearsal(read_params(root)):", "if False:"),
    Named("one person signs twice", SIGNING,
          'if person.key.keyid in {entry["keyid"] for entry in signatures}:', "if False:"),
    Named("an envelope of another card", PAPERS, "if signed.card.name != name:", "if False:"),
    Named("two cards at once", PAPERS, "            if others:", "            if False:"),
    Named("a rehearsal is judged as signed", PAPERS,
          "if is_rehearsal(read_params(root)):", "if False:"),
    Named("a draft that names other reports", JUDGE,
          "if draft.reports != chain.hashes:", "if False:"),
    Named("a draft for another candidate", JUDGE,
          "if draft.candidate != candidate or draft", "if draft"),
    Named("a draft of another checkpoint", JUDGE,
          "if draft.candidate != candidate or draft.candidate_checkpoint_sha256 != pinned:",
          "if draft.candidate != candidate:"),
    Named("a draft that leaves out a caveat", JUDGE, "return lacking and f", "return '' and f"),
    Named("the rollback may differ from the draft", CARD, '    "rollback",\n', ""),
    Named("the task may differ from the draft", CARD, '    "task",\n', ""),
    Named("the authors may differ from the draft", CARD, '    "authors",\n', ""),
    Named("an empty spotter, rollback or task", CARD,
          "sorted({*empty, *silent,", "sorted({*silent,"),
    Named("a text that nobody sees is filled in", CARD,
          "sorted({*empty, *silent,", "sorted({*empty,"),
    Named("a card expires a day late", CARD,
          "(today > last, f", "(today > last + datetime.timedelta(1), f"),
    Named("a card expires a day early", CARD, "(today > last, f", "(today >= last, f"),
    Named("a card begins a day early", CARD,
          "(today < first, f", "(today < first - datetime.timedelta(1), f"),
    Named("a card is a day too long", CARD,
          "(last - first).days + 1 > maximum_days", "(last - first).days > maximum_days"),
    Named("an empty set of abort thresholds", CARD,
          "sorted({*ABORT_FROM, *draft.abort_thresholds,", "sorted({*draft.abort_thresholds,"),
    Named("an abort threshold is raised", CARD, "not 0 <= value <= limit:", "not 0 <= value:"),
    Named("a card is drafted of who failed", CARD,
          'report.verdict != "PASS" or name is None', "name is None"),
    Named("starts are compared one way", TRIAL,
          "len(own ^ _starts(", "len(own - _starts("),
    Named("starts are compared the other way", TRIAL,
          "len(own ^ _starts(evidence, settings, name))",
          "len(_starts(evidence, settings, name) - own)"),
    Named("one state under many numbers", TRIAL,
          'if (states := part["start_sha256"].nunique()) < len(planned):', "if (states := 0):"),
    Named("starts that nobody planned", TRIAL,
          'if set(part["start"]) != planned:', "if False:"),
    Named("counts are rounded to the better side", BOUNDS,
          "if favourable else math.ceil(product)", "if not favourable else math.ceil(product)"),
    Named("counts are rounded down", BOUNDS,
          "math.floor(product) if favourable else math.ceil(product)", "math.floor(product)"),
    Named("rows are counted for clusters", BOUNDS,
          "trials = len(set(np.asarray(clusters).tolist()))\n    return",
          "trials = len(hits)\n    return"),
    Named("no criterion at all is PASS", VERDICTS,
          'max(verdicts, key=SEVERITY.__getitem__, default="INCONCLUSIVE")',
          'max(verdicts, key=SEVERITY.__getitem__, default="PASS")'),
    Named("no candidate at all is PASS", VERDICTS,
          'min(verdicts, key=SEVERITY.__getitem__, default="INCONCLUSIVE")',
          'min(verdicts, key=SEVERITY.__getitem__, default="PASS")'),
    Named("what was not measured passes", VERDICTS,
          'if measured is None or limit is None:\n        return "INCONCLUSIVE"',
          'if measured is None or limit is None:\n        return "PASS"'),
    Named("an unfinished rollout is a success", ITSELF,
          "chain(_ended(rows), _ticked(rows), ", "chain(_ticked(rows), "),
    Named("ticks that are neither command, hold nor fallback", ITSELF,
          "yield np.equal(sum(parts.values()), ticks), ",
          "yield np.less_equal(sum(parts.values()), ticks), "),
    Named("a condition that nobody met", ROLLOUTS, "    if absent:", "    if False:"),
    Named("fewer starts than planned", ROLLOUTS,
          "if int(per_condition.min()) < planned:", "if False:"),
    Named("any row of a chunk is taken", STUB,
          "return bytes_of(action) == bytes_of(admitted.actions[row])", "return True"),
    Named("a new session keeps old observations", STUB,
          "session_epoch=session_epoch, newest_observation_ns=None, tcp_m=None",
          "session_epoch=session_epoch, tcp_m=None"),
    Named("a new session keeps where the arm was seen", STUB,
          "session_epoch=session_epoch, newest_observation_ns=None, tcp_m=None",
          "session_epoch=session_epoch, newest_observation_ns=None"),
    Named("the stub believes an old time", STUB,
          "now_ns = max(now_ns, self._journal.latest_ns)", "now_ns = now_ns"),
    Named("an event voids by images alone", CHECKS,
          "min(chunk.times.condition_ns, chunk.measured_ns)", "chunk.times.condition_ns"),
    Named("who has no name commands", CHECKS, "return bool(expected) and ", "return "),
    Named("a person's turn keeps the last command", STUB,
          "        if mode == ExecutorMode.INTERVENTION:\n            self._continuity.forget()\n",
          ""),
    Named("the stub forgets how the queue stopped", STUB,
          "return replace(view, stopped=self.supervisor.stopped)", "return view"),
    Named("a full queue takes one more", CHECKS,
          "lambda m: m.waiting < m.capacity", "lambda m: m.waiting <= m.capacity"),
    Named("an older chunk stays beside a newer one", QUEUE,
          "            self._trim(now_ns, old, view, newer_start_ns=about.times.start_ns)\n", ""),
    Named("a broken chain goes on", QUEUE, "and not keeps_chain:", "and False:"),
    Named("a layer that is unknown passed", ARRIVAL,
          "all(layer.passed is True for layer in layers)", "all(layer.passed for layer in layers)"),
    Named("five layers are enough", ARRIVAL, "len(layers) == LAYER_COUNT and ", ""),
    Named("a chunk that was turned away uses up its name", ARRIVAL,
          "if at_door is None:  # what is turned away must not use up", "if True:  #"),
    Named("the executor keeps old observations over a reset", EXECUTOR,
          "session_epoch=epoch, newest_observation_ns=None, tcp_m=None",
          "session_epoch=epoch, tcp_m=None"),
    Named("a reset keeps what is in flight", EXECUTOR, "        self._in_flight.clear()\n", ""),
    Named("only the person hands back: anybody does", EXECUTOR,
          "if self.mode is ExecutorMode.INTERVENTION:\n            self._enter(now_ns, "
          "ExecutorMode.RUN)",
          "if True:\n            self._enter(now_ns, ExecutorMode.RUN)"),
)  # fmt: skip
"""Wrongs by hand, in the order of their modules."""


def run_named(only: Sequence[str], *, green: bool) -> int:
    """Ask the tests of each wrong; prints a line each.

    Args:
        only: Modules or folders; all where none is named.
        green: Whether the tests are known to be green without a wrong, and not asked first.

    Returns:
        How many turned no test red.

    Raises:
        SystemExit: A test is red without any wrong.
    """
    chosen = [row for row in NAMED if not only or row.path.startswith(tuple(only))]
    left = 0
    for package in ("genpolicy", "gates"):  # to ask of `gates`, genpolicy is imported for good
        rows = [row for row in chosen if row.path.startswith(f"{package}/")]
        if rows:
            warm_up(sorted({name for row in rows for name in tests_of(row.path)}), package)
        if not green:
            require_green({row.path: tests_of(row.path) for row in rows})
        for row in rows:
            tests = tests_of(row.path)
            name, seconds, red = outcome(row.path, row.text, tests[:1])
            if name != KILLED:  # most are noticed by the nearest, in seconds
                name, more, red = outcome(row.path, row.text, tests)
                seconds += more
            left += name != KILLED
            print(f"{name} | {row.path} | {row.wrong} | {seconds:.1f} s | {red}", flush=True)
    print(f"{len(chosen)} wrongs, {left} turned no test red")
    return left
