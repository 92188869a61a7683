"""Audits of planted causes, and their evidence."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[2] / "audit"))


from built_once import built_once


@pytest.fixture(scope="session")
def audits(tmp_path_factory, request):
    """Folder of the evidence by name of the case."""
    from audited_cases import CASES
    from planar import SETTINGS, audited

    from genpolicy.audit.documents import Obstacle
    from genpolicy.audit.evidence import write_evidence

    def build(folder):
        for name, options in CASES.items():
            (folder / name).mkdir(parents=True)
            obstacles = [Obstacle(x_m=0.15, y_m=0.0, radius_m=0.04)]
            result = audited(seed_of_audit=1, **options)
            write_evidence(result, folder / name, settings=SETTINGS, obstacles=obstacles)

    made = built_once(request, tmp_path_factory, "audits-of-cases", build)
    return {name: made / name for name in CASES}
