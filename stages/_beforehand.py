"""`python -m stages._beforehand`: what a late stage would refuse at once, asked before the first.

Limits that are not those that are pinned stop `shadow`, an hour behind the first training. Stage
`task` cannot ask for them, since Gate A would then rest on settings of the executor and be judged
again with each of them. The flows ask here before they start DVC; the stages ask all the same.
"""

import sys
from pathlib import Path

from genpolicy.errors import GenpolicyError
from stages._limits import require_pinned_limits
from stages._stage import load_params


def main() -> int:
    """Ask of the current folder; what `params.yaml` lacks is left to the first stage to say.

    Returns:
        0, or the exit code of the refusal, whose words are on stderr.
    """
    try:
        params = load_params()
    except GenpolicyError:
        return 0
    try:
        require_pinned_limits(params, Path())
    except GenpolicyError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main())
