"""TOML of a scenario file, with advice where it is none."""

import re
import tomllib
from typing import Any

from tendonff.compensator.files.text import InputError


def toml_of(text: str, file: str) -> dict[str, Any]:
    """Tables of a scenario's text; InputError names the file, the line and, for a usual slip, its correction."""
    if _DEEP_KEY.search(text):
        raise InputError(f"{file}: a key has more than {_MOST_PARTS} parts; none of a scenario has more than three")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise InputError(f"{file} is nested too deeply to be a scenario") from None
    except ValueError as error:  # TOMLDecodeError, and numbers of thousands of digits
        raise InputError(f"{file}: not valid TOML: {error}{_advice(text, str(error))}") from None


_MOST_PARTS = 50
_PART = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
_DEEP_KEY = re.compile(rf"""(?<![\w"'-]){_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{{_MOST_PARTS}}}""")
"""A key in so many parts that tomllib takes a minute for it."""

_NO_TOML = (
    (r"(\w+)\s*=\s*([-+]?\d+),(\d+)", "; a decimal point, not a comma: {0} = {1}.{2}"),
    (r"(\w+)\s*=\s*([A-Za-z][\w./-]*)", '; text stands in quotes: {0} = "{1}"'),
    (
        r"(\w+)\s*=\s*([-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?)\s*[A-Za-z%°]\S*",
        "; a number alone, the key says its unit: {0} = {1}",
    ),
    (r"(\w+)\s*=\s*([-+]?\.\d+)", "; a digit before the point: {0} = 0{1}"),
    (r"(\w+)\s*=\s*([-+]?\d+)\.", "; a digit after the point: {0} = {1}.0"),
)
"""Common mistakes in TOML, and their corrections."""


def _advice(text: str, error: str) -> str:
    """The way out of what tomllib refuses, where the line shows a usual slip; else empty."""
    place = re.search(r"at line (\d+)", error)
    lines = text.splitlines()
    if place is None or not 0 < (number := int(place[1])) <= len(lines):
        return ""
    line = lines[number - 1].partition("#")[0].strip()
    if error.startswith("Cannot overwrite"):
        return f"; {line.partition('=')[0].strip()} stands here a second time: keep one"
    if error.startswith("Cannot declare"):
        return f"; {line} stands here a second time: put the keys of both into one"
    for pattern, advice in _NO_TOML:
        if len(line) < 200 and (found := re.fullmatch(pattern, line)):
            return advice.format(*found.groups())
    return ""
