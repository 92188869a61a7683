"""Further trainings in the synthetic evidence: what Gate D's stage leaves of each."""

import evidence
import numpy as np

from gates.preregistration import PREREGISTRATION, plan_bytes
from gates.settings import read_params
from genpolicy.evidence.documents.stress import folder_of_seed
from genpolicy.evidence.rows.stress import RecoveryRow
from genpolicy.integrity.tables import read_table

ROLLOUTS = "stress/rollouts.parquet"


def trained_more(root, won, *, seeds=(0, 1, 2)):
    """All methods that are trained here run with each further seed, as with the first.

    Args:
        root: A ladder.
        won: By method and seed (also the first): on which starts it succeeds, given their numbers;
            who is not named succeeds as with the first.
        seeds: As `policy.seeds`.
    """
    evidence.write_params(root, lambda params: params["policy"].update(seeds=list(seeds)))
    (root / PREREGISTRATION).write_bytes(plan_bytes(read_params(root)))
    first = read_table(root / "artifacts" / ROLLOUTS).to_pandas()
    for seed in seeds:
        rows = first.assign(seed=seed)
        for (method, of), where in won.items():
            if of == seed:
                rows = ended(rows, method, where)
        place = "stress" if seed == seeds[0] else f"stress/{folder_of_seed(seed)}"
        write_rollouts(root, place, rows)
    evidence.document(root, "stress/trainings.json", {"seeds": list(seeds[1:])})
    evidence.record(root)


def ended(rows, method, where):
    """A method succeeds on these starts and times out on all others, in every condition."""
    own = (rows["method"] == method).to_numpy()
    success = np.where(own, where(rows["start"].to_numpy()), rows["success"]).astype(bool)
    outcome = np.where(own, np.where(success, "success", "timeout"), rows["outcome"])
    recovered = success & rows["recovery_attempted"].to_numpy()
    return rows.assign(success=success, outcome=outcome, recovered=recovered)


def write_rollouts(root, folder, rows):
    """Rollouts of a folder, with an entry into recovery of each that attempted one."""
    kind = evidence.RolloutRow
    evidence.table(root, f"{folder}/rollouts.parquet", kind, rows.to_dict("records"))
    entered = evidence.recoveries_of(rows)
    evidence.table(root, f"{folder}/recoveries.parquet", RecoveryRow, entered)
