"""How many random examples a property is tried on."""

import os

from hypothesis import settings


def tried_on(count: int) -> settings:
    """So many examples in the nightly run, which draws them anew; a third in the ordinary one, always the same."""
    return settings(max_examples=count if os.environ.get("HYPOTHESIS_PROFILE") == "fresh" else -(-count // 3))
