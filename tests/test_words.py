"""The manual, the README, docstrings, messages and templates use the field's terms."""

import ast
import functools
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

REFUSED = {
    r"wish(es)?|wanted tension|tension wanted": "reference",
    r"told|tells?\b.{0,20}\bapart|unless said": "identified, reported, stated; separate; by default",
    r"played( again| back)?": "simulated, re-simulated",
    r"rows? of sections": "list of sections",
    r"(leaves?|leaving|left) (up to |only |some )?\d[\d.]* ?%": "RMS error N % of range",
    r"hopeless|rivals?|calm|sober|scouted|lazy|poor": "the property that is meant",
    r"nobody|somebody": "the subject that is meant",
    r"dead band": "deadband",
    r"turned round|the other way round": "inverted; conversely",
    r"stands? still|stood still": "at rest, constant",
    r"(has|have) a say|not worth its while|pays for itself": "the reason",
    r"knows? (more|nothing|no)\b": "neglects, contains no",
    r"for ever|goes on for ever": "continuous, periodic",
    r"what it is worth|is worth on": "its error",
}
"""House words, and what to write instead."""

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
SOURCES = [
    path
    for top in ("models", "ocp", "compensator", "benchmarks", "examples", "docs")
    for path in sorted((ROOT / top).rglob("*.py"))
]

TEMPLATES = [
    path
    for top in ("ocp", "compensator", "examples")
    for path in sorted((ROOT / top).rglob("*"))
    if path.suffix in {".j2", ".toml"}
]


def prose(page: str) -> str:
    """Text of a page without code blocks, code spans, formulas and the addresses of links; lines are kept."""
    spans = r"^( *)```.*?^\1```|`[^`\n]+`|\\\(.*?\\\)|^\\\[.*?^\\\]|\]\([^)\s]+\)"
    return re.sub(spans, lambda found: "\n" * found[0].count("\n"), page, flags=re.MULTILINE | re.DOTALL)


ANY = re.compile("|".join(REFUSED).replace(" ", r"\s+"), re.IGNORECASE)
"""Whether a text is worth the search word by word."""


def refused(text: str) -> list[str]:
    """Each house word with its line and the term instead; words may be parted by a line break."""
    if not ANY.search(text):
        return []
    return [
        f"line {text.count(chr(10), 0, found.start()) + 1}: {' '.join(found[0].split())!r}, better: {better}"
        for words, better in REFUSED.items()
        for found in re.finditer(r"\b(?:" + words.replace(" ", r"\s+") + r")(?!(?<=\w)\w)", text, re.IGNORECASE)
    ]


@functools.cache
def nodes_of(path: Path) -> list[ast.AST]:
    """Nodes of a file's syntax tree, parsed once for all tests."""
    return list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


def docstrings(path: Path) -> list[tuple[int, str]]:
    """Line and text of the docstrings of a file: module, classes, functions, and texts under a name."""
    nodes = [each for each in nodes_of(path) if isinstance(each, ast.Expr)]
    texts = [(each.lineno, each.value.value) for each in nodes if isinstance(each.value, ast.Constant)]
    return [(line, text) for line, text in texts if isinstance(text, str)]


def messages(path: Path) -> list[tuple[int, str]]:
    """Line and text of the strings of a file that are sentences: three words at least, values as braces."""
    nodes = nodes_of(path)
    parts = {part for each in nodes if isinstance(each, ast.JoinedStr) for part in each.values}
    parts |= {each.value for each in nodes if isinstance(each, ast.Expr)}  # docstrings
    texts = []
    for node in nodes:
        if isinstance(node, ast.JoinedStr):
            texts.append((node.lineno, "".join(p.value if isinstance(p, ast.Constant) else "{}" for p in node.values)))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in parts:
            texts.append((node.lineno, node.value))
    return [(line, text) for line, text in texts if text.count(" ") >= 2]


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_a_page_has_no_house_words(page: Path) -> None:
    assert refused(prose(page.read_text(encoding="utf-8"))) == []


def test_docstrings_have_no_house_words() -> None:
    """The places are named with the term to use."""
    assert [
        f"{path.relative_to(ROOT)}:{line}: {word}"
        for path in SOURCES
        for line, text in docstrings(path)
        for word in refused(text)
    ] == []


def test_messages_have_no_house_words() -> None:
    assert [
        f"{path.relative_to(ROOT)}:{line}: {word}"
        for path in SOURCES
        for line, text in messages(path)
        for word in refused(text)
    ] == []


def test_templates_and_example_scenarios_have_no_house_words() -> None:
    assert [
        f"{path.relative_to(ROOT)}: {word}" for path in TEMPLATES for word in refused(path.read_text(encoding="utf-8"))
    ] == []


def test_docstrings_begin_with_a_noun_or_an_imperative() -> None:
    assert [
        f"{path.relative_to(ROOT)}:{line}: {text.splitlines()[0]}"
        for path in SOURCES
        for line, text in docstrings(path)
        if re.match(r"(What|How|One|Who|Told|Says)\b", text)
    ] == []


@pytest.mark.parametrize(
    "text",
    [
        "the wish itself",
        "mu is told\nonly together",
        "It leaves 0.05 % of range",
        "path at rest leaves 22 %",
        "dead\nband",
    ],
)
def test_house_words_are_found_across_lines_and_forms(text: str) -> None:
    assert len(refused(text)) == 1


@pytest.mark.parametrize("text", ["plays compose", "`told`", "leaves no profile", "\\(told\\)", "storytold", "toldest"])
def test_terms_code_and_other_words_are_not(text: str) -> None:
    assert refused(prose(text)) == []
