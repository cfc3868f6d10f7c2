"""Import of published models: `python -m benchmarks.import_models MODEL.xml ...`.

For each model: tendons whose tables are within the bars at 300 unseen poses (lengths 1e-5 m, bends 2e-3 rad RMS, moment
arms 1e-4 m), worst errors of those imported, refusals with their reasons, time of the import of all that it takes.
The models are not part of this repository: https://github.com/google-deepmind/mujoco (model/, test/) and
https://github.com/MyoHub/myo_sim, both Apache-2.0. Meshes are left out before reading, for tendons do not touch them.
"""

import argparse
import re
import sys
import tempfile
import time
import xml.etree.ElementTree as ET
from pathlib import Path

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.mjcf.model import read_hand
from tendonff.compensator.mjcf.run import run_import

DROPPED = {
    "mesh",
    "texture",
    "material",
    "skin",
    "hfield",
    "sensor",
    "keyframe",
    "contact",
    "equality",
    "visual",
    "flex",
}


def tree(path: Path, base: Path) -> ET.Element:
    """A model file with its includes, which are named relative to the main one."""
    root = ET.parse(path).getroot()  # noqa: S314 - models that the user names
    holders = [(parent, child) for parent in root.iter() for child in parent if child.tag == "include"]
    for parent, child in holders:
        place = list(parent).index(child)
        parent.remove(child)
        file = base / child.get("file", "")
        for k, each in enumerate(tree(file, base) if file.exists() else ()):
            parent.insert(place + k, each)
    return root


def without_meshes(path: Path, folder: Path) -> Path:
    """The model with bones of its inertias alone, and plain motors on its tendons."""
    root = tree(path, path.parent)
    for parent in list(root.iter()):
        for child in list(parent):
            if (
                child.tag in DROPPED
                or (child.tag == "geom" and child.get("type") in ("mesh", "hfield", "sdf"))
                or child.get("mesh")
            ):
                parent.remove(child)
            child.attrib.pop("material", None)
    root.append(ET.Element("compiler", boundmass="1e-3", boundinertia="1e-6"))
    for actuators in root.iter("actuator"):
        for each in list(actuators):
            if each.get("tendon") is None:
                actuators.remove(each)
            each.tag, kept = "motor", {name: each.attrib[name] for name in ("name", "tendon") if name in each.attrib}
            each.attrib.clear()
            each.attrib.update(kept)
    target = folder / path.name
    target.write_text(ET.tostring(root, encoding="unicode"))
    return target


def tendon_names(path: Path) -> list[str]:
    """Tendons of a model, those of actuators first where it has some."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(path))
    pulled = {
        int(model.actuator_trnid[k, 0])
        for k in range(model.nu)
        if model.actuator_trntype[k] == mujoco.mjtTrn.mjTRN_TENDON
    }
    return [model.tendon(k).name or f"tendon{k}" for k in sorted(pulled) or range(model.ntendon)]


def crossed(model: Path, tendon: str) -> list[str]:
    """Joints that a tendon crosses."""
    return list(read_hand(model, tendons=[tendon]).names)


def one(path: Path, folder: Path, verbose: bool) -> None:
    """Print a model's lines."""
    model = without_meshes(path, folder)
    names = tendon_names(model)
    taken, surveys, refused, narrowed, near = [], [], [], [], []
    for name in names:
        ranges: list[str] = []
        for attempt in range(4):
            try:
                out = folder / f"{name}_{attempt}" / "hand.toml"
                found = run_import(model, tendons=[name], joints=ranges, near=near, out=out)
            except InputError as error:
                said = str(error).partition(": ")[2]
                if site := re.search(r"--near (\S+) or", said):
                    near.append(site[1])
                elif way := re.findall(r"--joint (\S+)", said):
                    ranges = way
                    refused.append(said)
                else:
                    refused.append(said)
                    break
            else:
                (narrowed if ranges else taken).append(name)
                surveys += found.survey.tendons
                if verbose:
                    print(found.survey.text().splitlines()[1], flush=True)
                break
    good = sum(tendon.fits for tendon in surveys)
    print(f"{path.name}: {good} of {len(names)} tendons within the bars, {len(narrowed)} of them in a smaller range")
    for line in refused:
        print(f"    {line}")
    if not taken:
        return
    worst = [max(getattr(t, key) for t in surveys) for key in ("length_error_m", "wrap_rms_rad", "arm_error_m")]
    print(f"    worst: length {worst[0]:.1e} m, bends {worst[1]:.1e} rad, moment arms {worst[2]:.1e} m")
    begun = time.perf_counter()
    cpu = time.process_time()
    run_import(model, tendons=taken, near=near, out=folder / "all" / "hand.toml")
    hand = read_hand(model, tendons=taken, near=near)
    print(
        f"    {len(taken)} tendons over {len(hand.joints)} joints in {time.perf_counter() - begun:.1f} s "
        f"({time.process_time() - cpu:.1f} s of processor)",
        flush=True,
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("models", type=Path, nargs="+")
    parser.add_argument("--verbose", action="store_true")
    args = parser.parse_args()
    for path in args.models:
        with tempfile.TemporaryDirectory() as folder:
            one(path, Path(folder), args.verbose)


if __name__ == "__main__":
    sys.exit(main())
