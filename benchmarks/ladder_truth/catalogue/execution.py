"""Wrongs between a sampled chunk and the controller: projection, layers, queue, supervisor."""

from benchmarks.ladder_truth.outcome import Expected
from benchmarks.ladder_truth.planting import Wrong, all_of, patched

C = "C"
SEEN = ("mutants_undetected", "checker_violations")
STALE = ("stub_stale", "corrupted_refused_share", *SEEN)
INVALID = ("stub_invalid", "corrupted_refused_share", *SEEN)
LOST = ("conservation_error", *SEEN)
PINNED = r"fixtures\.yaml"
EXECUTOR = "genpolicy/execution/executor.py"
QUEUE = "genpolicy/execution/chunk_queue.py"
STUB = "genpolicy/execution/stub.py"
SUPERVISOR = "genpolicy/execution/supervisor.py"
DYNAMIC = "genpolicy/feasibility/layers/dynamic.py"

SELECTOR = "genpolicy/candidates/selector.py"
PEEKS = patched(
    SELECTOR,
    ('"""The candidate whose turn it is, unseen: ', '"""The candidate of the best worth: '),
    ("OWNER = ", "WORTH = lambda candidate: 0.0\nOWNER = "),
    (
        "    chosen = candidates[index]\n",
        "    chosen = sorted(candidates, key=lambda c: WORTH(c))[index]\n",
    ),
)
"""A selector that takes the candidate that is worth most, by what it is given to see."""
SHOWN = patched(
    "genpolicy/evidence/stress/rollout.py",
    (
        "from genpolicy.candidates.selector import tries_another\n",
        "from genpolicy.candidates import selector\n"
        "from genpolicy.candidates.selector import tries_another\n",
    ),
    (
        "        late = self._deliveries.late_rows(flying, self.now_s)\n",
        "        late = self._deliveries.late_rows(flying, self.now_s)\n"
        "        ahead, checker = self._delivery_context(late), self.setup.checker\n"
        "        selector.WORTH = lambda one: isinstance(\n"
        "            checker.admit(Proposal(one.metadata, one.actions, 'peek'), context=ahead),\n"
        "            Rejected)\n",
    ),
)
"""What decides is asked before the selector chooses: whether the layers will take a candidate."""

WRONGS = (
    Wrong("projection_without_a_limit", "projection",
          "Projection may move a chunk as far as it likes.",
          "small",
          patched("genpolicy/feasibility/layers/representation.py",
                  ("float(moved if relative[0] <= relative[1] else turned)", "1.0")),
          Expected(C, ("projection_p95_m", *INVALID))),
    Wrong("collisions_always_pass", "projection", "The geometric layer never finds a collision.",
          "small",
          patched("genpolicy/feasibility/layers/geometric.py",
                  ("    for i, hit in enumerate(report.hits):\n        if hit is not None:",
                   "    for i, hit in enumerate(report.hits):\n        if False:")),
          Expected(C, INVALID)),
    Wrong("speed_of_the_tcp_is_not_limited", "projection",
          "The dynamic layer forgets the speed of the TCP.",
          "small",
          patched(DYNAMIC, ("- speed.max(axis=1)", "- 0.0 * speed.max(axis=1)")),
          Expected(C, INVALID)),
    Wrong("checked_before_projection", "projection",
          "The layers judge the raw chunk, and the projected one is delivered.",
          "small",
          patched("genpolicy/feasibility/admission.py",
                  ("verdicts = self.check_many(projected, contexts)",
                   "raw = [Projected(p, p.actions, 0.0, 0.0) for p in proposals]\n"
                   "        verdicts = self.check_many(raw, contexts)")),
          Expected(C, INVALID)),
    Wrong("queue_takes_what_is_stale", "queue", "The queue asks nothing of what arrives.",
          "small",
          patched(QUEUE, ("        check = refusal(self._checks, Place.ARRIVAL, moment)\n",
                          "        check = None\n")),
          Expected(C, STALE)),
    Wrong("stub_accepts_everything", "queue", "The controller stub refuses nothing.",
          "small",
          patched(STUB, ("check = refusal(self.checks, Place.STUB, moment)", "check = None")),
          Expected(C, (*STALE, "stub_invalid"))),
    Wrong("waiting_chunks_go_stale", "queue", "What waits in the queue is not asked again.",
          "small",
          patched(QUEUE, ("            check = self._ask(Place.QUEUE, now_ns, chunk, view)\n",
                          "            check = None\n")),
          Expected(C, STALE)),
    Wrong("events_void_nothing", "queue",
          "After a force, a collision or a change of phase the queue keeps what it holds.",
          "small",
          patched(QUEUE, ("            if refusal(checks, Place.QUEUE, moment) is not None:\n",
                          "            if False:\n")),
          Expected(C, STALE)),
    Wrong("refused_chunks_are_not_counted", "queue",
          "A chunk that is refused on arrival is in no balance.",
          "small",
          patched("genpolicy/execution/ledger.py",
                  ("        self.discarded_chunks[reason] += 1\n", "")),
          Expected(C, LOST)),
    Wrong("age_is_noted_as_zero", "queue", "The journal notes every action as fresh.",
          "small",
          patched(STUB, ('"age_ns": now_ns - about.times.condition_ns', '"age_ns": 0')),
          Expected(C, SEEN)),
    Wrong("rows_beyond_the_horizon", "queue",
          "Rows behind the execution horizon are executed too.",
          "small",
          patched("genpolicy/execution/cell.py",
                  ("horizons.execution_horizon,", "horizons.prediction_horizon,")),
          Expected(C, SEEN)),
    Wrong("any_row_follows_any_other", "queue",
          "Nobody asks whether the way from the last command to the next row was checked.",
          "small",
          patched("genpolicy/execution/continuity.py",
                  ("            return row == last.row + 1 and holds == 0\n"
                   "        if row != about.checked_rows[0]:\n"
                   "            return False\n",
                   "            return True\n")),
          Expected(C, SEEN)),
    Wrong("force_limit_upside_down", "supervisor",
          "The force gate trips below the limit, not above it.",
          "small",
          patched(SUPERVISOR, (
              "0.0 <= float(force_n) <= limit_n", "0.0 <= limit_n <= float(force_n)")),
          Expected("A", refusal=PINNED)),
    Wrong("watchdog_sleeps", "supervisor", "The supervisor's watchdog never holds.",
          "small",
          patched(SUPERVISOR, (
              "if self.state is SupervisorState.RUN and silent:", "if False and silent:")),
          Expected("A", refusal=PINNED)),
    Wrong("controller_is_stiffer", "supervisor",
          "The contact controller has another stiffness than the one that was pinned.",
          "small",
          patched("genpolicy/robot/impedance.py", (
              "self._stiffness = np.repeat([STIFFNESS_N_M,",
              "self._stiffness = np.repeat([2 * STIFFNESS_N_M,")),
          Expected("A", refusal=PINNED)),
    Wrong("nobody_polls_the_watchdog", "supervisor",
          "The stub's clock does not ask the supervisor any more.",
          "small",
          patched(STUB, ("elif self.supervisor.poll(now_ns):\n", "elif False:\n")),
          Expected(C, SEEN)),
    Wrong("a_stop_is_not_heeded", "supervisor",
          "Executor and stub go on after the supervisor has stopped.",
          "small",
          patched(STUB, ("stopped=self.supervisor.stopped", "stopped=False")),
          Expected(C, STALE)),
    Wrong("peeking_selector", "selection",
          "The selector is told which candidates the layers will take, and proposes these first.",
          "small", all_of(PEEKS, SHOWN),
          Expected("D", refusal=r"is another chunk than was drawn by invocation \d+|"
                                r"candidate \d+ is (up to|drawn as) .* required what "
                                r"[0-9a-f]{16}… draws"),
          note="Added with the import contract of the selector, which no ladder runs."),
    Wrong("judged_where_it_was_shown", "selection",
          "The comparison begins where the demonstrations began, so that all was seen in training.",
          "small",
          patched("genpolicy/evidence/stress/matched.py",
                  ('stream(root_seed, "starts", index)',
                   'stream(root_seed, "session", index, "start")')),
          Expected("D", refusal=r"starts of the comparison among its episodes"),
          note="Added with the refusal that it names."),
)  # fmt: skip
