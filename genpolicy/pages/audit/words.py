"""What a reader is told beside the numbers: what each verdict means, the words, how to read."""

TITLES = {
    "valid_modes": "Valid modes",
    "hidden_state": "Hidden state",
    "data_defect": "Data defect",
    "label_contamination": "Wrong labels",
    "pointwise_noise": "Noise, not modes",
    "unimodal": "One action",
    "insufficient_support": "Not enough to say",
}
MEANINGS = {
    "valid_modes": "One observation has several actions, each works, and nothing recorded or past "
    "explains which was taken. Simple policies may lose them: a generator can be worth its cost.",
    "hidden_state": "What looks like several actions is one action per value of a variable that "
    "the policy does not see. A generator would only hide it.",
    "data_defect": "The data are not what they claim to be. Modes counted on them may be made by "
    "the defect, so nothing further is believed.",
    "label_contamination": "Outcome labels disagree with what a replay does, so no mode can be "
    "called valid by its label.",
    "pointwise_noise": "Actions differ from step to step without any strategy that lasts. "
    "Averaging over a chunk removes it.",
    "unimodal": "No two separate actions were found under one observation, in what was "
    "looked at: the simple policies are enough.",
    "insufficient_support": "The data cannot answer. That is not the same as one action: what "
    "is missing is said below.",
}
TONES = {
    "valid_modes": "pass",
    "hidden_state": "fail",
    "data_defect": "fail",
    "label_contamination": "fail",
    "pointwise_noise": "simple",
    "unimodal": "simple",
    "insufficient_support": "open",
}
MARKS = {"holds": "✓", "red": "✕", "open": "?", "not believed": "·"}
READING = (
    "The verdict and what it rests on: would you accept what was guessed or not recorded?",
    "The topics: the first red one decides; topics below it are not believed.",
    "The situations: from nearly the same observation, do the actions fall into separate bundles?",
    "The mean and the modes: does the mean of what was demonstrated run into something?",
    "What explains the modes: is there a variable that nobody recorded and that would?",
)
WORDS = {
    "situation": "one recorded moment of a held-out episode, whose nearest observations in other "
    "episodes were compared",
    "chunk": "the actions that a policy commands from one observation",
    "mode": "a cluster of whole chunks that keeps its episodes together over time",
    "scale": "the difference that makes an observation another one, declared per unit in the "
    "settings",
    "held-out": "from episodes that stand apart from those searched for neighbours",
    "realigned": "with every measured clock offset taken out",
    "alike": "in what predicts the action, learned from other episodes, where none stands near",
    "confidence": "share of audits of resampled data that name the same cause, less what such "
    "audits get wrong together and, where modes are denied, what could not be looked at",
    "adjusted p": "after Holm's correction over all variables and phases",
}


def short(value: float) -> str:
    """A number for the eye: whole ones as they are, others with three digits."""
    if value == int(value) and abs(value) < 1e6:
        return f"{int(value)}"
    return f"{value:.3g}"
