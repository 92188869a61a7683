"""What the commands take agrees with what they call."""

from typing import get_args

from genpolicy.cli.commands import Format
from genpolicy.data.formats import FORMATS


def test_the_layouts_of_the_option_are_those_that_are_known():
    assert get_args(get_args(Format)[0]) == FORMATS
