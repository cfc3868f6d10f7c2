"""What is made while the pages are built: figures, lists from the code, and the formulas' typesetter."""

import re
import runpy
import shutil
import tempfile
from importlib.resources import as_file, files
from pathlib import Path
from typing import TYPE_CHECKING

from mkdocs.structure.files import File
from mkdocs.utils import get_relative_url

from tendonff.compensator.reporting.plots import save_figure

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[1]
_MODULES = re.compile(r"<!-- modules of (\w+) -->")
_KEYS = "<!-- keys of a scenario -->"
_MATHS = "assets/mathjax/tex-svg.js"


def on_files(files: "Files", config: "MkDocsConfig") -> "Files":
    """Add the figures: `figures/NAME.py` with a function `draw` gives `figures/NAME.svg`.

    Parameters
    ----------
    files : Files
    config : MkDocsConfig
    """
    for script in sorted((ROOT / "docs" / "figures").glob("*.py")):
        with tempfile.TemporaryDirectory() as folder:
            (svg,) = save_figure(runpy.run_path(str(script))["draw"](), Path(folder) / script.stem, ("svg",))
            files.append(File.generated(config, f"figures/{svg.name}", content=svg.read_text(encoding="utf-8")))
    return files


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
