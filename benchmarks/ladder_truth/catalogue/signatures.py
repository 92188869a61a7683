"""Wrongs in the trial card, its signatures and the people behind them: gate E."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml

from benchmarks.ladder_truth import sealing as base
from benchmarks.ladder_truth.outcome import Expected
from benchmarks.ladder_truth.planting import Plant, Wrong, document

E = "E"
VOID = ("signature_valid", "upstream_passed")


def _people(change: Callable[[list[dict[str, Any]]], Any]) -> Plant:
    def plant(workspace: Path) -> None:
        path = workspace / "reviewers.yaml"
        listed = yaml.safe_load(path.read_text())
        change(listed["people"])
        path.write_text(yaml.safe_dump(listed))

    return plant


def _signed_again(
    change: Callable[[dict[str, Any]], Any], signers: tuple[str, ...] = base.SIGNERS
) -> Plant:
    """Real keys over another statement, past every check of `genpolicy card sign`."""

    def plant(workspace: Path) -> None:
        statement = base.statement_of(workspace)
        change(statement["predicate"])
        base.sign_statement(workspace, statement, signers)

    return plant


def _payload_edited(workspace: Path) -> None:
    statement = base.statement_of(workspace)
    statement["predicate"]["force_limit_n"] = 300.0
    base.replace_payload(workspace, statement)


def _second_card(workspace: Path) -> None:
    (envelope,) = (workspace / "cards").glob("*.dsse.json")
    (workspace / "cards" / "another.dsse.json").write_bytes(envelope.read_bytes())


def _another_key(people: list[dict[str, Any]]) -> None:
    for person in people:
        if person["id"] == "sam":
            person["public_key"] = "ab" * 32


def _reviewer_is_author(people: list[dict[str, Any]]) -> None:
    for person in people:
        if person["id"] == "rita":
            person["role"] = "author"


def _card_by_author(card: dict[str, Any]) -> None:
    card["reviewer"] = "ada"


def _expired(card: dict[str, Any]) -> None:
    card.update(not_before="2026-01-01", expires="2026-01-20")


WRONGS = (
    Wrong("report_changed_after_signing", "signatures",
          "Gate D's report was changed after the card was signed.",
          "signed",
          document("reports/gate_d.json", lambda r: r["criteria"][2].update(measured=0.99)),
          Expected(E, VOID, refusal=r"gate_d")),
    Wrong("evidence_changed_after_signing", "signatures",
          "A shadow document was changed after the card was signed.",
          "signed",
          document("artifacts/shadow/checker.json", lambda d: d.update(checked_actions=10**6)),
          Expected(E, VOID, refusal=r"shadow")),
    Wrong("card_changed_after_signing", "signatures",
          "The draft allows twice the speed since it was signed.",
          "signed", document("artifacts/card/card.json", lambda d: d.update(speed_limit_m_s=0.5)),
          Expected(E, (*VOID, "envelope_within_limits"), refusal=r"card")),
    Wrong("payload_under_old_signatures", "signatures",
          "The signed card's force limit is ten times as high, under the old signatures.",
          "signed", _payload_edited, Expected(E, ("signature_valid",))),
    Wrong("three_owners", "signatures", "The owner of safety did not sign.",
          "signed", _signed_again(lambda card: None, base.SIGNERS[:-1]),
          Expected(E, ("owners_signed",))),
    Wrong("no_reviewer", "signatures", "The reviewer named on the card did not sign it.",
          "signed", _signed_again(lambda card: None, base.SIGNERS[1:]),
          Expected(E, ("reviewer_independent",))),
    Wrong("author_reviews", "signatures", "An author reviews and signs the own candidate.",
          "signed", _signed_again(_card_by_author, ("ada", *base.SIGNERS[1:])),
          Expected(E, ("reviewer_independent", "signature_valid"))),
    Wrong("stranger_signs", "signatures", "A key that nobody listed is among the signatures.",
          "signed", _signed_again(lambda card: None, (*base.SIGNERS, "eve")),
          Expected(E, ("signature_valid",))),
    Wrong("expired_card", "signatures", "The card was valid in January only.",
          "signed", _signed_again(_expired), Expected(E, ("not_expired",))),
    Wrong("larger_envelope_signed", "signatures",
          "People signed a card that allows more speed than was simulated.",
          "signed", _signed_again(lambda card: card.update(speed_limit_m_s=0.5)),
          Expected(E, ("envelope_within_limits", "signature_valid"))),
    Wrong("caveats_left_out", "signatures",
          "People signed a card from which every caveat of its draft was taken.",
          "signed", _signed_again(lambda card: card.update(caveats=[])),
          Expected(E, ("signature_valid", "draft_complete"))),
    Wrong("force_limit_left_empty", "signatures", "People signed a card without a force limit.",
          "signed", _signed_again(lambda card: card.update(force_limit_n=None)),
          Expected(E, ("draft_complete", "signature_valid"))),
    Wrong("key_withdrawn", "signatures", "The owner of safety has another key since.",
          "signed", _people(_another_key), Expected(E, ("signature_valid",))),
    Wrong("reviewer_becomes_author", "signatures",
          "The reviewer turns out to be an author of the candidate.",
          "signed", _people(_reviewer_is_author),
          Expected(E, ("reviewer_independent", "owners_signed", "signature_valid"))),
    Wrong("two_cards", "signatures", "A second card lies beside the signed one.",
          "signed", _second_card, Expected(E, ("signature_valid",))),
)  # fmt: skip
