"""What a contract leaves open, in sentences: they travel with the dataset into every verdict."""

from genpolicy.data.formats.contract import UNKNOWN_UNIT, ImportContract

WORDS = {
    "place": "a place in another unit or from another origin",
    "change": "a change per row",
    "rate": "a rate per second",
}
ASKED = ("phase", "object", "operator", "calibration_epoch", "outcome", "is_recovery")


def open_questions(contract: ImportContract) -> list[str]:
    """A sentence for each guess and each question that the recordings do not answer."""
    notes: list[str] = []
    guessed = [
        f"{channel.name} ({channel.unit})"
        for channel in contract.channels
        if channel.guessed and channel.unit != UNKNOWN_UNIT
    ]
    if contract.action.guessed:
        units = dict.fromkeys(unit for unit in contract.action.units if unit != UNKNOWN_UNIT)
        guessed += [f"action ({', '.join(units)})"] if units else []
    if guessed:
        notes.append(f"Units were guessed: {', '.join(guessed)}.")
    unknown = [c.name for c in contract.channels if c.unit == UNKNOWN_UNIT]
    unknown += ["action"] if UNKNOWN_UNIT in contract.action.units else []
    if unknown:
        notes.append(f"Units are not recorded and could not be guessed: {', '.join(unknown)}.")
    if contract.rate_guessed:
        notes.append(f"The rate was guessed: {contract.rate_hz:g} Hz.")
    if contract.pairing is None:
        notes.append(
            "The action commands nothing that is observed: lag and calibration cannot be measured."
        )
    elif contract.pairing_guessed:
        pairs = ", ".join(f"{a} with {o}" for a, o in contract.pairing.items())
        notes.append(f"What the action commands was found in the numbers, not in names: {pairs}.")
    notes += forms_notes(contract)
    if contract.format not in ("mcap", "dataset"):
        missing = [name for name in ASKED if getattr(contract.labels, name) is None]
        if missing:
            notes.append(f"Not recorded: {', '.join(missing)}.")
        if contract.labels.time is None:
            notes.append("No clock was recorded: times are row / rate.")
    return notes


def forms_notes(contract: ImportContract) -> list[str]:
    """What the action's numbers mean where they are no plain places, and where nobody knows."""
    kinds: dict[tuple[str, str], list[str]] = {}
    for name, form in contract.forms.items():
        if form.form == "unknown" or form.is_plain:
            continue
        partner = (contract.pairing or {}).get(name)
        key = WORDS[form.form], f"{abs(form.gain):.3g}"
        minus = "minus " if form.gain < 0 else ""
        kinds.setdefault(key, []).append(name + (f" of {minus}{partner}" if partner else ""))
    said = [f"{word} (gain {gain}): {', '.join(names)}" for (word, gain), names in kinds.items()]
    how = "was found in the numbers" if contract.forms_guessed else "is declared"
    notes = [f"What the action means {how}: {'; '.join(said)}."] if said else []
    unknown = [name for name, form in contract.forms.items() if form.form == "unknown"]
    if unknown:
        notes.append(
            f"Nothing tells whether the action's {', '.join(unknown)} say where, how far or how "
            "fast: they are read as places. Declare `forms` in the contract if you know."
        )
    return notes
