"""Draw the gallery from the root: `python docs/gallery_pictures.py`; its scripts are in `examples/gallery`."""

import runpy
from pathlib import Path

import matplotlib as mpl

ROOT = Path(__file__).resolve().parents[1]

if __name__ == "__main__":
    mpl.use("agg")
    for script in sorted((ROOT / "examples" / "gallery").glob("*.py")):
        figure = runpy.run_path(str(script))["figure"]
        figure.set_size_inches(7.0, 7.0 * figure.get_figheight() / figure.get_figwidth())
        figure.savefig(ROOT / "docs" / "gallery" / f"{script.stem}.png", dpi=110, metadata={"Software": None})
