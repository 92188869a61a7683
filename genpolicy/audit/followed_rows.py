"""Row of the one table of the audit that training reads: a file of its own.

Another column of the audit would train every baseline anew, were it spelled beside this one. This
file imports nothing.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Demonstration:
    """`demonstrated.parquet`: the mode that one episode followed; unknown ones are left out.

    Attributes:
        episode_uuid: The episode.
        phase: The phase with most situations.
        mode: The mode that it followed there, as clustered or by its nearest chunks.
    """

    episode_uuid: str
    phase: str
    mode: str
