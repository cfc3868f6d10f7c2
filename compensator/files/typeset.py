"""Numbers in text as they are printed: large ones without an exponent, a true minus sign, one sign for "+-"."""

import re

_EXPONENT = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?)e([+-]\d+)(?![\w.])")
_MINUS = re.compile(r"(?:^|(?<=[\s(\[±]))-(?=\d)")  # not in names, ranges and options of commands
_PLUS_MINUS = re.compile(r"(?<!\w)\+-(?=\s?\d)")
_PLAIN_POWERS = range(7)
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def typeset(text: str) -> str:
    """A text with its numbers as they are printed; commands in it stay as they are typed."""
    return _MINUS.sub("\N{MINUS SIGN}", _PLUS_MINUS.sub("±", _EXPONENT.sub(_written_out, text)))


def _written_out(number: re.Match[str]) -> str:
    mantissa, power = number[1], int(number[2])
    if power not in _PLAIN_POWERS:
        return f"{mantissa}·10{str(power).translate(_RAISED)}"
    return f"{float(number[0]):.{max(0, len(mantissa.partition('.')[2]) - power)}f}"
