"""Stage `candidates`: the policies that are brought to the ladder, by hash.

It runs every time (`always_changed`): their files lie outside the tree, where nothing else sees an
edit. What it writes changes only when they do, and then every measurement of them is made anew.
"""

from pathlib import Path

from gates.proof import admit
from genpolicy.candidates.brought import BroughtSection, require_brought
from genpolicy.evidence.documents.brought import BROUGHT, brought_document
from genpolicy.integrity.atomic import output_folder
from stages._stage import ARTIFACTS, Params, main


def work(params: Params) -> None:
    """Admit through gate A, then write who they are."""
    admit("candidates", Path.cwd())
    section = params.section("candidates", BroughtSection)
    found = require_brought(section.root, horizons=params.horizons)
    with output_folder(ARTIFACTS / "candidates") as folder:
        BROUGHT.write(folder, brought_document(found))


if __name__ == "__main__":
    main("candidates", work)
