"""Stage `card`: draft the trial card of the promoted candidate; a person completes and signs it."""

from pathlib import Path

from gates.card.card import card_bytes
from gates.card.drafting import draft
from gates.proof import admit
from genpolicy.integrity.atomic import output_folder, write_bytes
from stages._stage import ARTIFACTS, Params, main


def work(params: Params) -> None:
    """Admit through gate D, then draft; the fields of the reviewer stay empty."""
    del params  # parsed already; the section `card` is read by the draft itself
    admission = admit("card", Path.cwd())
    with output_folder(ARTIFACTS / "card") as folder:
        write_bytes(
            folder / "card.json", card_bytes(draft(Path.cwd(), admission.reports, admission.hashes))
        )


if __name__ == "__main__":
    main("card", work)
