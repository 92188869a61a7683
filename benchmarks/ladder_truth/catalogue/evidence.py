"""Evidence that is not what its stage wrote, and reports that are not what the judge said."""

from pathlib import Path

import pandas as pd

from benchmarks.ladder_truth.outcome import Expected
from benchmarks.ladder_truth.planting import (
    Wrong,
    all_of,
    committed,
    document,
    patched,
    silently,
    table,
)
from benchmarks.ladder_truth.workspace import set_limit
from genpolicy.data.assemble import MANIFEST_FILE, seal
from genpolicy.integrity.documents import read_json
from genpolicy.integrity.hashing import sha256_file

RESTORED = (
    "At first DVC, to which a copy is new, hashed the file and restored it; now it has seen it."
)
OTHER = {"flow": "diffusion", "diffusion": "flow"}


def _forged_pass(workspace: Path) -> None:
    """A limit that does not hold, and a report that says PASS all the same."""
    set_limit(workspace, "gate_a", "held_out_situations", 1e6)
    document("reports/gate_a.json", lambda report: report.update(verdict="PASS"))(workspace)


def _swapped(frame: pd.DataFrame) -> pd.DataFrame:
    return frame.assign(method=[OTHER.get(name, name) for name in frame["method"]])


def _without_decode(frame: pd.DataFrame) -> pd.DataFrame:
    return frame[~((frame["method"] == "flow") & (frame["component"] == "decode"))]


def _only_successes(frame: pd.DataFrame) -> pd.DataFrame:
    flow = frame["method"] == "flow"
    return frame.assign(success=frame["success"] | flow)


def _admissible(frame: pd.DataFrame) -> pd.DataFrame:
    layers = ("representation", "kinematic", "geometric", "dynamic", "contact", "fresh")
    frame = frame.copy()
    for name in layers:
        frame[name] = frame[name].dtype.type(True) if frame[name].dtype == bool else True
    return frame.assign(first_reason="", outcome="passed")


def _never_valid(frame: pd.DataFrame) -> pd.DataFrame:
    noisy = frame["method"] == "bc_noise"
    columns = ("modes_covered", "admissible", "valid", "modes_valid", "fewest_admissible")
    return frame.assign(**{name: frame[name].mask(noisy, 0) for name in columns})


def _other_operators(frame: pd.DataFrame) -> pd.DataFrame:
    return frame.assign(operator=frame["operator"].to_numpy()[::-1])


def _explained_by_nothing(frame: pd.DataFrame) -> pd.DataFrame:
    tests = {"p_value": 1.0, "p_adjusted": 1.0}
    return frame.assign(**tests, effect=0.0, effect_lower=0.0, effect_upper=0.05)


def _in_the_modes(frame: pd.DataFrame) -> pd.DataFrame:
    flow = frame["method"] == "flow"
    lost = ("between_modes", "far_from_modes")
    frame = frame.assign(**{name: frame[name].mask(flow, 0) for name in lost})
    whole = {name: frame[name].mask(flow, frame["samples"]) for name in ("admissible", "valid")}
    each = frame["samples"] // frame["modes_present"]
    return frame.assign(
        **whole,
        modes_covered=frame["modes_covered"].mask(flow, frame["modes_present"]),
        modes_valid=frame["modes_valid"].mask(flow, frame["modes_present"]),
        fewest_admissible=frame["fewest_admissible"].mask(flow, each),
    )


def _sealed_again(workspace: Path) -> None:
    """The manifest names the tables as they lie there now, as ingest would have written it."""
    folder = workspace / "artifacts/ingest"
    manifest = read_json(folder / MANIFEST_FILE)
    files = {name: sha256_file(folder / name) for name in manifest["files"]}
    (folder / MANIFEST_FILE).write_bytes(seal({**manifest, "files": files}))


def _fewer_rollouts(frame: pd.DataFrame) -> pd.DataFrame:
    return frame[~((frame["method"] == "flow") & (frame["start"] == 1))]


OF_ANOTHER = """

def _instead_of(policy):
    from pathlib import Path

    from genpolicy.policies.policy import load_policy

    others = {"flow": "diffusion"}
    if policy.method not in others:
        return policy
    return load_policy(Path("artifacts/train_generators") / others[policy.method] / "seed_0")


def step("""
"""Whoever is called a flow is a diffusion; its hashes stay those of the flow."""


def _unjudged(workspace: Path) -> None:
    folder = workspace / "artifacts/stress/journals"
    folder.mkdir(exist_ok=True)  # synthetic evidence has none
    (folder / "extra.mcap").write_bytes(b"nobody judged this")


def _page_says_pass(workspace: Path) -> None:
    """The page of Gate A names a verdict that no gate gave."""
    page = workspace / "reports/gate_a.html"
    page.write_text(page.read_text() + "<p>Gate D: PASS</p>\n")


WRONGS = (
    Wrong("bit_in_the_dataset", "evidence",
          "One bit of the audited frames is flipped; size and times stay.",
          "small", silently("artifacts/ingest/frames.parquet"),
          Expected("A", refusal=r"sha256 of artifacts/ingest/frames\.parquet"), note=RESTORED),
    Wrong("bit_in_a_stress_journal", "evidence",
          "One bit of a closed-loop journal is flipped; size and times stay.",
          "small", silently("artifacts/stress/journals/*.mcap"),
          Expected("D", refusal=r"sha256 of artifacts/stress/journals"), note=RESTORED),
    Wrong("forged_pass", "evidence", "Gate A does not pass, and its report says PASS.",
          "small", _forged_pass, Expected("A", ("held_out_situations",))),
    Wrong("rollouts_edited", "evidence",
          "All rollouts of the flow are marked as successes, and committed.",
          "small",
          all_of(table("artifacts/stress/rollouts.parquet", _only_successes), committed("stress")),
          Expected("D", refusal=r"rollout .*success")),
    Wrong("rollouts_swapped", "evidence",
          "The rollouts of the two candidates are exchanged, and committed.",
          "small",
          all_of(table("artifacts/stress/rollouts.parquet", _swapped), committed("stress")),
          Expected("D", refusal=r"rollout ")),
    Wrong("a_rollout_is_left_out", "evidence",
          "The rollouts of the flow from one start are left out, and committed.",
          "small",
          all_of(table("artifacts/stress/rollouts.parquet", _fewer_rollouts), committed("stress")),
          Expected("D", ("unmatched_starts",), refusal=r"rollout ")),
    Wrong("a_remedy_is_never_valid", "evidence",
          "Chunked BC with noise is written down as valid nowhere, and that is committed.",
          "small",
          all_of(table("artifacts/measure_baselines/modes.parquet", _never_valid),
                 committed("measure_baselines")),
          Expected("A", (), refusal=r"bc_noise \(seed 0\)")),
    Wrong("the_dataset_is_forged", "evidence",
          "Who demonstrated is mixed up in the dataset, which is sealed and committed.",
          "brought",
          all_of(table("artifacts/ingest/episodes.parquet", _other_operators),
                 _sealed_again, committed("ingest")),
          Expected("A", (), refusal=r"artifacts/ingest/episodes\.parquet: operator of row"),
          note="Named with the check that derives the dataset from its recordings again."),
    Wrong("the_audit_is_forged", "evidence",
          "No variable explains the modes, by the audit's table, and that is committed.",
          "small",
          all_of(table("artifacts/audit/strata.parquet", _explained_by_nothing),
                 committed("audit")),
          Expected("A", (), refusal=r"artifacts/audit/strata\.parquet: .* as measured again")),
    Wrong("every_sample_is_in_a_mode", "evidence",
          "No sample of the flow lies between the modes, by its table, and that is committed.",
          "small",
          all_of(table("artifacts/reload/modes.parquet", _in_the_modes), committed("reload")),
          Expected("B", (), refusal=r"flow \(seed 0\)")),
    Wrong("shadow_candidates_edited", "evidence",
          "Every shadow candidate is written down as admissible, and committed.",
          "small",
          all_of(table("artifacts/shadow/candidates.parquet", _admissible), committed("shadow")),
          Expected("C", ("corrupted_refused_share",), refusal=r"candidates")),
    Wrong("checker_says_more_than_it_saw", "evidence",
          "The checker's document claims a thousand checked actions, and is committed.",
          "small",
          all_of(
              document("artifacts/shadow/checker.json",
                       lambda d: d.update(checked_actions=1000, reproved_actions=1000)),
              committed("shadow"),
          ),
          Expected("C", ("checker_violations",), refusal=r"checker\.json")),
    Wrong("a_latency_term_is_missing", "evidence",
          "The flow's decoding time is in no table, and that is committed.",
          "small",
          all_of(table("artifacts/latency/latency.parquet", _without_decode), committed("latency")),
          Expected("B", ("latency_terms_missing",), refusal=r"decode", candidate="flow")),
    Wrong("a_file_that_nobody_judged", "evidence",
          "A journal lies beside those that were judged.",
          "small", _unjudged,
          Expected("D", refusal=r"extra\.mcap"),
          note="Stopped before DVC, which would check the folder out anew and remove it."),
    Wrong("rollouts_of_another_checkpoint", "evidence",
          "The chunks of the flow's rollouts are drawn by the diffusion, under the flow's hashes.",
          "small",
          patched("genpolicy/evidence/stress/matched.py", ("\n\ndef step(", OF_ANOTHER),
                  ("drawn = policy.sample(", "drawn = _instead_of(policy).sample(")),
          Expected("D", refusal=r"flow__\w+\.mcap: flow/.* beside it|flow: \w+, start \d+ is "
                   "another chunk than was drawn"),
          note="Added with the check that draws chunks again. The stage `monitors` asks the same "
          "before; its words were added after the first run with it, which had counted elsewhere."),
    Wrong("shadow_of_another_checkpoint", "evidence",
          "The flow's shadow candidates are drawn by the diffusion, under the flow's hashes.",
          "small",
          patched("genpolicy/evidence/shadow/shadow.py",
                  ("\n\ndef case_of(", OF_ANOTHER.replace("def step(", "def case_of(")),
                  ("drawn = policy.sample(", "drawn = _instead_of(policy).sample(")),
          Expected("C", refusal=r"candidate flow/.* beside it"), note="Added with the one above."),
    Wrong("noise_chosen_for_the_rollouts", "evidence",
          "Every rollout draws by noise of its own choice, and says so.",
          "small",
          patched("genpolicy/evidence/stress/rollout.py",
                  ('return "stress", self.setup.perturbation, self.start_index, self.invocations',
                   'return "stress", self.setup.perturbation, 1, self.invocations')),
          Expected("D", refusal=r"the noise of .* by the plan"),
          note="Added with the one above. It drew by the noise of a start 7 at first, which nobody "
          "planned and by which two of three rollouts were reset."),
    Wrong("an_outcome_that_never_happened", "evidence",
          "A rollout of the flow whose time runs out is a success, by its journal and its row.",
          "small",
          patched("genpolicy/evidence/stress/matched.py",
                  ("rollout.end(Outcome.TIMEOUT)",
                   'called = rollout.setup.method != "flow" or rollout.person.calls\n'
                   "        rollout.end(Outcome.TIMEOUT if called else Outcome.SUCCESS)")),
          Expected("D", refusal=r"flow__\S+\.mcap: flow/.*: outcome is success"),
          note="Added with the check that plays recorded commands again. An episode in which a "
          "person was called is left alone: the checker says that it is no success. Was run with "
          "a pattern that knew no `@` in the name of a journal, and is elsewhere for that."),
    Wrong("a_drill_that_never_comes", "evidence",
          "The condition that calls for recovery on every start calls for none.",
          "small",
          patched("genpolicy/evidence/stress/disturbance.py",
                  ("self._drill_s = drill_s(", "self._drill_s = None and drill_s(")),
          Expected("D", refusal=r"its drill was due .* had none"),
          note="Took the place of `pushes_that_never_come`: the small ladder pushes nobody, "
               "so that nothing had been planted."),
    Wrong("page_and_lock_forged", "evidence",
          "The printed page of Gate A says more than its report, and that is committed.",
          "small", all_of(_page_says_pass, committed("gate_a")),
          Expected("A", refusal=r"reports/gate_a\.html is another page"),
          note="Added with the check that prints recorded pages again."),
    Wrong("a_file_beside_signed_evidence", "evidence",
          "A journal lies beside those on which a signed card stands.",
          "signed", _unjudged, Expected("E", ("upstream_passed",), refusal=r"extra\.mcap")),
)  # fmt: skip
