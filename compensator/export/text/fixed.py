"""Fixed text of exported C."""

from importlib.resources import files


def prefixed(text: str, prefix: str) -> str:
    """Fixed text of C under another prefix."""
    return text.replace("tff_", f"{prefix}_").replace("TFF_", f"{prefix.upper()}_")


def core_file(name: str, prefix: str) -> str:
    """Fixed text of a module."""
    return prefixed(files("tendonff.compensator.export").joinpath(f"core/tff_{name}").read_text("utf-8"), prefix)
