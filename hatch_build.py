"""While the package is built: the README as a package index shows it, with addresses that lead to the repository."""

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

_LINK = re.compile(r"(!?\[[^\]]*\]\()(?!https?:|#)([^)]+\))")


def absolute(markdown: str, source: str) -> str:
    """Markdown whose relative links and pictures are addressed in the repository.

    Parameters
    ----------
    markdown : str
    source : str
        Address of the repository, `Source` in [project.urls].
    """

    def address(found: re.Match[str]) -> str:
        kind = "raw" if found[1].startswith("!") else "blob"
        return f"{found[1]}{source}/{kind}/main/{found[2]}"

    return _LINK.sub(address, markdown)


def unlinked(markdown: str) -> str:
    """Markdown without relative links and pictures, which lead nowhere outside the repository.

    Parameters
    ----------
    markdown : str
    """
    return _LINK.sub(lambda found: "" if found[1].startswith("!") else found[1][1:-2], markdown)


class ReadmeHook(MetadataHookInterface):
    """Gives the metadata their README."""

    def update(self, metadata: dict[str, Any]) -> None:
        """See hatchling.

        Parameters
        ----------
        metadata : dict
        """
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        source = metadata.get("urls", {}).get("Source")
        readme = unlinked(text) if source is None else absolute(text, source)
        metadata["readme"] = {"content-type": "text/markdown", "text": readme}
