"""Build steps of the pages: figures, lists from the code, and the formulas' typesetter."""

import re
import runpy
import shutil
import tempfile
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import TYPE_CHECKING

from mkdocs.structure.files import File
from mkdocs.utils import get_relative_url

import tendonff as tf
from tendonff.compensator.reporting.plots import save_figure

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[1]
_NAMES = re.compile(r"^Names: (.+)$", re.MULTILINE)
_OTHERS = "the others"
_KEYS = "<!-- keys of a scenario -->"
_CODE = re.compile(r"<!-- code: (\S+) -->")
_SOURCE = re.compile(r"\[(`[^`]+\.py`)\]\(\.\./[^)]+\)")  # files of the repository, which the built pages do not hold
_MATHS = "assets/mathjax/tex-svg.js"


def on_files(files: "Files", config: "MkDocsConfig") -> "Files":
    """Add the figures: `figures/NAME.py` with a function `draw` gives `figures/NAME.svg`.

    Parameters
    ----------
    files : Files
    config : MkDocsConfig
    """
    for script in sorted((ROOT / "docs" / "figures").glob("*.py")):
        svg = _drawn(script, script.stat().st_mtime_ns)
        files.append(File.generated(config, f"figures/{script.stem}.svg", content=svg))
    return files


@cache
def _drawn(script: Path, _changed: int) -> str:
    """A figure as SVG; while pages are served, drawn again only when its script changes."""
    with tempfile.TemporaryDirectory() as folder:
        (svg,) = save_figure(runpy.run_path(str(script))["draw"](), Path(folder) / script.stem, ("svg",))
        return svg.read_text(encoding="utf-8")


def on_page_markdown(markdown: str, **_: object) -> str:
    """Replace the markers of a page.

    Parameters
    ----------
    markdown : str
    """
    markdown = _NAMES.sub(lambda found: _directives(found[1]), markdown)
    markdown = _SOURCE.sub(r"\1", _CODE.sub(lambda found: _script(found[1]), markdown))
    return markdown.replace(_KEYS, _keys()) if _KEYS in markdown else markdown


def on_page_content(html: str, **_: object) -> str:
    """Docstrings mark literal blocks by `::`, which Markdown takes as text; figures open alone, for small screens.

    Parameters
    ----------
    html : str
    """
    html = re.sub(r'(<img [^>]*src="([^"]*figures/[^"]+)"[^>]*>)', r'<a href="\2">\1</a>', html)
    return html.replace("<p>::</p>\n", "").replace("::</p>", ":</p>")


def on_post_page(output: str, page: "Page", **_: object) -> str:
    """Load the typesetter where there are formulas.

    Parameters
    ----------
    output : str
    page : Page
    """
    if 'class="arithmatex"' not in output:
        return output
    sources = (get_relative_url(path, page.url) for path in ("assets/mathjax-config.js", _MATHS))
    return output.replace("</body>", "".join(f'<script src="{s}"></script>' for s in sources) + "</body>")


def on_post_build(config: "MkDocsConfig") -> None:
    """Ship MathJax, with its licence, from the package that carries it.

    Parameters
    ----------
    config : MkDocsConfig
    """
    target = Path(config.site_dir) / _MATHS
    target.parent.mkdir(parents=True, exist_ok=True)
    with as_file(files("mathjax") / "static" / "mathjax") as carried:
        shutil.copy(carried / "es5" / "tex-svg.js", target)
        shutil.copy(carried / "LICENSE", target.parent)


def _directives(names: str) -> str:
    """Directives for public names; on the last page, for those that no other page has."""
    if names != _OTHERS:
        return "\n".join(f"::: tendonff.{name}\n" for name in re.findall(r"`(\w+)`", names))
    pages = " ".join(page.read_text(encoding="utf-8") for page in (ROOT / "docs" / "api").glob("*.md"))
    taken = {name for found in _NAMES.findall(pages) for name in re.findall(r"`(\w+)`", found)}
    left = [name for name in tf.__all__ if not name.startswith("_") and name not in taken]
    return "\n".join(f"::: tendonff.{name}\n" for name in left) or "There are none at present."


def _script(name: str) -> str:
    """A script of the repository without its docstring, which the page replaces."""
    code = (ROOT / name).read_text(encoding="utf-8")
    return "```python\n" + re.sub(r'^""".*?"""\n+', "", code, flags=re.DOTALL) + "```"


def _keys() -> str:
    """The commented scenario that `tendonff new` writes, its comments close behind the values."""
    template = (ROOT / "compensator" / "scenario" / "scenario.toml").read_text(encoding="utf-8")
    return f"```{{ .toml .wrapped }}\n{re.sub(r' {3,}#', '  #', template)}```\n"
