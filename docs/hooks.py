"""Pages that are made from the code: the API's list of modules, and the keys of a scenario file."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
_MODULES = re.compile(r"<!-- modules of (\w+) -->")
_KEYS = "<!-- keys of a scenario -->"


def on_page_markdown(markdown: str, **_: object) -> str:
    """Replace the markers of a page.

    Parameters
    ----------
    markdown : str
    """
    markdown = _MODULES.sub(lambda found: "\n".join(_modules(found[1])), markdown)
    return markdown.replace(_KEYS, _keys()) if _KEYS in markdown else markdown


def on_page_content(html: str, **_: object) -> str:
    """Docstrings mark literal blocks by `::`, which Markdown takes as text.

    Parameters
    ----------
    html : str
    """
    return html.replace("<p>::</p>\n", "").replace("::</p>", ":</p>")


def _modules(package: str) -> list[str]:
    """One directive for each public module of a package."""
    folder = ROOT / package
    names = [
        ".".join(path.relative_to(ROOT).with_suffix("").parts)
        for path in sorted(folder.rglob("*.py"))
        if not any(part.startswith("_") for part in path.relative_to(folder).with_suffix("").parts)
        and "cli" not in path.relative_to(folder).parts  # described under commands
    ]
    return [f"::: tendonff.{name}\n" for name in names]


def _keys() -> str:
    """The commented scenario that `tendonff new` writes."""
    template = (ROOT / "compensator" / "scenario" / "scenario.toml").read_text(encoding="utf-8")
    return f"```toml\n{template}```\n"
