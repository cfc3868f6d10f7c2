"""Pages made from the executed notebooks: one each, and the gallery of their pictures."""

import base64
import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mkdocs.structure.files import File

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files

NOTEBOOKS = sorted((Path(__file__).resolve().parents[1] / "notebooks").glob("*.ipynb"))
_GALLERY = "<!-- gallery -->"
_PNG = "image/png"


def on_files(files: "Files", config: "MkDocsConfig") -> "Files":
    """Add a page for each notebook, and its pictures.

    Parameters
    ----------
    files : Files
    config : MkDocsConfig
    """
    for path in NOTEBOOKS:
        parts = []
        for cell in _cells(path):
            source = "".join(cell["source"])
            if cell["cell_type"] == "markdown":
                parts.append(source)
                continue
            parts.append(f"```python\n{_shown(source)}\n```")
            if text := "".join(map(_text, cell["outputs"])).rstrip():
                parts.append(f'<div class="output" markdown>\n\n```text\n{text}\n```\n\n</div>')
            for name, picture, alt in _pictures(path, cell):
                files.append(File.generated(config, f"figures/{name}", content=base64.b64decode(picture)))
                parts.append(f"![{alt}](../figures/{name})")
        files.append(File.generated(config, f"notebooks/{path.stem}.md", content="\n\n".join(parts) + "\n"))
    return files


def on_page_markdown(markdown: str, **_: object) -> str:
    """Put the gallery in its place.

    Parameters
    ----------
    markdown : str
    """
    return markdown.replace(_GALLERY, _gallery()) if _GALLERY in markdown else markdown


def _gallery() -> str:
    """Title, first paragraph and every picture of each notebook."""
    parts = []
    for path in NOTEBOOKS:
        cells = _cells(path)
        title, _, rest = "".join(cells[0]["source"]).partition("\n")
        page = f"notebooks/{path.stem}.md"
        shown = [picture for cell in cells if cell["cell_type"] == "code" for picture in _pictures(path, cell)]
        parts += [
            f"## [{title.lstrip('# ')}]({page})",
            rest.strip().split("\n\n")[0],
            *(f"![{alt}](figures/{name})" for name, _, alt in shown),
        ]
    return "\n\n".join(parts)


def _cells(path: Path) -> list[dict[str, Any]]:
    cells: list[dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return cells


def _shown(source: str) -> str:
    """Code without lines that only machines read."""
    return "\n".join(line for line in source.splitlines() if not re.match(r"%|#\| ", line))


def _text(output: dict[str, Any]) -> str:
    data = output.get("data", {})
    return "" if _PNG in data else "".join(output.get("text") or data.get("text/plain", ""))


def _pictures(path: Path, cell: dict[str, Any]) -> list[tuple[str, str, str]]:
    """File name, PNG in base 64 and alternative text of a cell's pictures."""
    return [
        (f"{path.stem}_{cell['execution_count']}_{k}.png", output["data"][_PNG], output["metadata"][_PNG]["alt"])
        for k, output in enumerate(cell["outputs"])
        if _PNG in output.get("data", {})
    ]
