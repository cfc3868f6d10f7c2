"""The record of tuned constants: few, and each with what set it."""

import re
from dataclasses import fields

from tendonff.compensator.identification.constants import Tuned

MOST = 70
SOURCE = re.compile(r"\((?:[^()]*\b)?(rigs|recordings|method|rule)\b[^()]*\)")


def test_the_record_has_at_most_seventy_constants_each_with_its_source():
    entries = re.findall(r"^    ([a-z_, ]+) : [^\n]+\n((?: {8}[^\n]+\n)+)", Tuned.__doc__, re.MULTILINE)
    described = [name for names, text in entries if SOURCE.search(text) for name in names.split(", ")]
    assert sorted(described) == sorted(field.name for field in fields(Tuned))
    assert len(described) <= MOST
