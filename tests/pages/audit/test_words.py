"""Every cause has its words."""

from gates.cause import CauseName
from genpolicy.pages.audit.ladder import OPEN, RED, UNBELIEVED
from genpolicy.pages.audit.words import MARKS, MEANINGS, TITLES, TONES


def test_every_cause_has_its_words():
    causes = {cause.value for cause in CauseName}
    assert set(TITLES) == set(MEANINGS) == set(TONES) == causes
    assert set(MARKS) == {"holds", RED, OPEN, UNBELIEVED}
