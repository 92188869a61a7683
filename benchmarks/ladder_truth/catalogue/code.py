"""Wrongs in what measures and judges: tests of the tests."""

from pathlib import Path

from benchmarks.ladder_truth.outcome import Expected
from benchmarks.ladder_truth.planting import Wrong, all_of, patched
from benchmarks.ladder_truth.workspace import set_limit
from genpolicy.integrity.documents import read_json

C, D = "C", "D"
CHECKER = "genpolicy/verification/checker.py"


def _unheeded_refusal(workspace: Path) -> None:
    """Gate C fails honestly, and the stage behind it does not ask."""
    assert read_json(workspace / "reports/gate_c.json")["verdict"] == "PASS"
    set_limit(workspace, "gate_c", "admissible_share", 0.99)


WRONGS = (
    Wrong("independent_checker_is_blind", "code", "The independent checker notes no violation.",
          "small",
          patched(CHECKER, (
              "        self.report.violations.append(Violation(self.name, self.n, rule, sentence))",
              "        del rule, sentence")),
          Expected(C, ("mutants_undetected",))),
    Wrong("checker_skips_the_freshness", "code",
          "The independent checker does not ask how old an action was.",
          "small",
          patched(CHECKER, ('        if not chunk["valid_until_ns"] - self.t >= 0:\n',
                            "        if False:\n")),
          Expected(C, ("mutants_undetected",))),
    Wrong("motion_is_not_proved", "code",
          "The independent proof of the motion of executed rows is left out.",
          "small",
          patched("genpolicy/verification/motion.py",
                  ("        yield from self._touching(held, phase)\n        contact =",
                   "        contact =")),
          Expected(C, ("mutants_undetected", "checker_violations"))),
    Wrong("every_mutant_counts_as_found", "code",
          "Whoever writes down the mutants writes `detected` for each.",
          "small",
          all_of(
              patched("genpolicy/evidence/shadow/mutants.py",
                      ("detected=bool(found) and not unchanged", "detected=True")),
              patched("genpolicy/execution/stub.py",
                      ("check = refusal(self.checks, Place.STUB, moment)", "check = None")),
          ),
          Expected(C, ("mutants_undetected", "stub_stale", "checker_violations",
                       "corrupted_refused_share"), refusal=r"mutants")),
    Wrong("a_criterion_is_deleted", "code",
          "The criterion on stale actions at the stub is taken out of gate C.",
          "small",
          patched("gates/feasibility/arrivals.py", ("def stub_stale(", "def _stub_stale(")),
          Expected(C, ("stub_stale",), refusal=r"stub_stale")),
    Wrong("a_stage_does_not_ask", "code",
          "Gate C does not pass, and the stage behind it runs without being admitted.",
          "small",
          all_of(
              _unheeded_refusal,
              patched("stages/stress.py",
                      ('admit("stress", Path.cwd()).candidates', '("diffusion", "flow")')),
          ),
          Expected(C, ("admissible_share",))),
    Wrong("further_candidates_are_free", "code",
          "The clock judges a second candidate at once, and no check of it is on record.",
          "small",
          patched("genpolicy/evidence/stress/deliveries.py",
                  ("        check_s = next_candidate(self._setup, flying, start=self._start)\n",
                   "        flying.candidate += 1\n"
                   "        self._arrived.appendleft(flying)\n"
                   "        return\n"
                   "        check_s = 0.0\n")),
          Expected("D", ("checker_violations", "refusal"))),
    Wrong("answers_come_a_tick_early", "code",
          "The clock delivers an answer one tick before its latency has passed.",
          "small",
          patched("genpolicy/evidence/stress/deliveries.py",
                  ("            elif flying.arrival_s <= now_s and flying.comes:",
                   "            elif (flying.comes and flying.arrival_s\n"
                   "                  <= now_s + self._setup.horizons.action_period_s):")),
          Expected("D", ("checker_violations", "refusal"))),
    Wrong("latencies_a_tenth_shorter", "code",
          "The virtual clock draws every measured time a tenth shorter than it was.",
          "small",
          patched("genpolicy/evidence/stress/latency.py",
                  ("            value = compute_factor * empirical_quantile(",
                   "            value = 0.9 * compute_factor * empirical_quantile(")),
          Expected(D, refusal=r"by the measured times")),
    Wrong("starts_differ_between_methods", "code",
          "The candidates begin from other states than the baselines.",
          "small",
          patched("genpolicy/evidence/stress/matched.py",
                  ("Rollout(setup, task.start_from_json(starts[number]), number,",
                   "Rollout(setup, task.sample_start(stream(len(shard.judged.name), number)),"
                   " number,")),
          Expected(D, ("unmatched_starts",))),
    Wrong("rollouts_are_called_success", "code",
          "Whoever writes down the rollouts writes success for each of them.",
          "small",
          patched("genpolicy/evidence/stress/shard_rows.py",
                  ("success=rollout.outcome is Outcome.SUCCESS,", "success=True,")),
          Expected(D, refusal=r"rollout .*success")),
    Wrong("post_is_thinner", "code",
          "The post of the scene is half as thick as in the scene that was pinned.",
          "small",
          lambda workspace: [
              patched(
                  path.relative_to(workspace).as_posix(),
                  ('name="post" class="scene" type="cylinder" size="0.025',
                   'name="post" class="scene" type="cylinder" size="0.0125'),
              )(workspace)
              for path in sorted((workspace / "genpolicy/tasks/tabletop_insertion").glob("*.xml"))
          ],
          Expected("A", refusal=r"fixtures\.yaml")),
    Wrong("robot_may_be_faster", "code",
          "The table of the robot's limits allows twice the joint velocity.",
          "small",
          patched("genpolicy/robot/limits.py", (
              "_joints(2.175, 2.175, 2.175, 2.175,", "_joints(4.35, 4.35, 4.35, 4.35,")),
          Expected("A", refusal=r"fixtures\.yaml")),
)  # fmt: skip
