"""What a proposal leaves open is said."""

from genpolicy.data.formats.open_questions import open_questions


def test_notes_say_what_is_open(layouts, tmp_path):
    from genpolicy.data.formats import propose

    contract = propose(layouts.v2(tmp_path / "a"))
    text = " ".join(open_questions(contract))
    assert "Units were guessed" in text
    assert "operator" in text
    sure = contract.model_copy(
        update={
            "channels": [c.model_copy(update={"guessed": False}) for c in contract.channels],
            "action": contract.action.model_copy(update={"guessed": False}),
            "pairing": None,
        }
    )
    text = " ".join(open_questions(sure))
    assert "guessed" not in text
    assert "commands nothing that is observed" in text
