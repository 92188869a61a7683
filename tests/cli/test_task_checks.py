"""Only the task of the data checks them."""

import json

from genpolicy.cli.task_checks import contract_hash
from genpolicy.contract.observation import ObservationContract
from genpolicy.tasks.api import load_task


def test_a_contract_in_a_manifest_has_the_hash_of_the_contract():
    contract: ObservationContract = load_task("tabletop_insertion").observation
    channels = [
        {"name": c.name, "components": list(c.components), "unit": c.unit, "stream": c.stream,
         "maximum_age_s": c.maximum_age_s}
        for c in contract.channels
    ]  # fmt: skip
    manifest = json.loads(json.dumps({"observation_contract": {"channels": channels, "dim": 1}}))
    assert contract_hash(manifest) == contract.hash()
