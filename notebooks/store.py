"""Run the notebooks and keep their outputs: `python notebooks/store.py [NOTEBOOK ...]`.

A cell that draws says in a first line `#| fig-alt: ...` what its picture shows, for those who cannot see it. Cells
whose numbers differ from run to run, such as times, carry the tag "varies". `tests/test_notebooks.py` compares.
"""

import base64
import io
import re
import sys
from pathlib import Path

import nbformat
from PIL import Image

FOLDER = Path(__file__).resolve().parent
VARIES = "varies"
_ALT = re.compile(r"^#\| fig-alt: (.+)\n", flags=re.MULTILINE)
_PICTURE = "image/png"
_KERNEL = {"display_name": "Python 3", "language": "python", "name": "python3"}


def executed(path: Path) -> nbformat.NotebookNode:
    """A notebook after a fresh run, with nothing in it that depends on the machine.

    Parameters
    ----------
    path : Path
    """
    from nbclient import NotebookClient  # the rest of this file needs no kernel

    notebook = nbformat.read(path, as_version=4)
    NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(FOLDER)}}).execute()
    notebook.metadata = nbformat.from_dict({"kernelspec": _KERNEL, "language_info": {"name": "python"}})
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)
        for output in cell.get("outputs", []):
            if _PICTURE in output.get("data", {}):
                output.data.pop("text/plain", None)
                output.data[_PICTURE] = small(output.data[_PICTURE])
                output.metadata = nbformat.from_dict({_PICTURE: {"alt": alt_text(cell)}})
    return notebook


def small(picture: str) -> str:
    """A picture, PNG in base 64, with a palette of its own: a third of the size, nothing that an eye would see.

    Parameters
    ----------
    picture : str
    """
    buffer = io.BytesIO()
    Image.open(io.BytesIO(base64.b64decode(picture))).convert("RGB").quantize(64).save(buffer, "PNG", optimize=True)
    return base64.b64encode(buffer.getvalue()).decode("ascii")


def alt_text(cell: nbformat.NotebookNode) -> str:
    """What the pictures of a cell show, in words.

    Parameters
    ----------
    cell : NotebookNode
    """
    found = _ALT.search(cell.source)
    if found is None:
        raise ValueError(f'a cell draws a picture but has no line "#| fig-alt: ...":\n{cell.source}')
    return " ".join(_ALT.findall(cell.source))


def texts(cell: nbformat.NotebookNode) -> str:
    """What a cell printed.

    Parameters
    ----------
    cell : NotebookNode
    """
    parts = (output.get("text") or output.get("data", {}).get("text/plain", "") for output in cell.get("outputs", []))
    return "".join(parts)


def pictures(cell: nbformat.NotebookNode) -> list[str]:
    """Pictures of a cell as PNG in base 64.

    Parameters
    ----------
    cell : NotebookNode
    """
    data = (output.get("data", {}) for output in cell.get("outputs", []))
    return [entry[_PICTURE] for entry in data if _PICTURE in entry]


if __name__ == "__main__":
    for name in sys.argv[1:] or sorted(FOLDER.glob("*.ipynb")):
        nbformat.write(executed(Path(name)), name)
