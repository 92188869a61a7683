"""`dvc`, which reads its lock file without what keeps comments: DVC writes none into it.

Behind each stage DVC reads the whole of `dvc.lock` by ruamel's round trip, in pure Python, which
takes most of what a stage costs beside its work. The same library reads the same values five times
as fast in C, and what is written is the same to the byte. A program by its path (`reproduce` starts
it); plain `dvc repro` does the same, slower.
"""

import sys

from dvc.cli import main
from dvc.utils.serialize import _yaml

if __name__ == "__main__":
    _yaml.parse_yaml_for_update = _yaml.parse_yaml
    sys.exit(main())
