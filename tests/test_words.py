"""The manual, the README, docstrings, messages and templates use the field's terms."""

import ast
import functools
import re
from pathlib import Path

import pytest

from tendonff.compensator.compensators.registry import COMPENSATORS

ROOT = Path(__file__).resolve().parents[1]

REFUSED = {
    r"wish(es)?|wanted tension|tension wanted": "reference",
    r"told|tells?\b.{0,20}\bapart|unless said": "identified, reported, stated; separate; by default",
    r"played( again| back)?": "simulated, re-simulated",
    r"rows? of sections": "list of sections",
    r"(leaves?|leaving|left) (up to |only |some )?\d[\d.]* ?%": "RMS error N % of range",
    r"hopeless|rivals?|calm|sober|scouted|lazy|poor": "the property that is meant",
    r"nobody|somebody": "the subject that is meant",
    r"turned round|the other way round": "inverted; conversely",
    r"stands? still|stood still": "at rest, constant",
    r"(has|have) a say|not worth its while|pays for itself": "the reason",
    r"knows? (more|nothing|no)\b": "neglects, contains no",
    r"for ever|goes on for ever": "continuous, periodic",
    r"what it is worth|is worth on": "its error",
}
"""House words, and what to write instead."""

GLOSSARY = ROOT / "docs" / "words.md"


def glossary() -> dict[str, str]:
    """Words of the last column of "Words used here", with the word to write instead."""
    rows = [line.strip("|").split("|") for line in GLOSSARY.read_text(encoding="utf-8").splitlines() if "|" in line]
    terms = [
        (row[0].strip(), row[3].split(",")) for row in rows if len(row) == 4 and row[0].strip() not in ("word", "---")
    ]
    return {word.strip(): term for term, others in terms for word in others if word.strip()}


def plural(word: str) -> str:
    """The word as a pattern, with its plural, and not as a part of another."""
    spaced = r"\s+".join(map(re.escape, word.split()))
    return rf"(?<![\w.-]){spaced}s?(?![\w-])"


ONE_NAME = {plural(word): term for word, term in glossary().items()}
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


SCENARIOS = [path for path in TEMPLATES if path.suffix == ".toml"]
EXPORTED = [
    path
    for top in ("compensator/export/templates", "ocp/step")
    for path in sorted((ROOT / top).rglob("*"))
    if path.suffix in {".c", ".h", ".j2"}
]


def text_of(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def comments(source: str) -> str:
    """What an exported file says to its reader: comments of C and Structured Text; of a page all of its prose."""
    return "\n".join(re.findall(r"/\*.*?\*/|//[^\n]*|\(\*.*?\*\)", source, re.DOTALL))


def other_names(text: str) -> list[str]:
    """Each other name of a thing that the glossary names, with its line."""
    return [
        f"line {text.count(chr(10), 0, found.start()) + 1}: {found[0]!r} is called {term!r}"
        for words, term in ONE_NAME.items()
        for found in re.finditer(words, text, re.IGNORECASE)
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


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_a_page_has_one_name_for_one_thing(page: Path) -> None:
    if page != GLOSSARY:
        assert other_names(prose(page.read_text(encoding="utf-8"))) == []


def test_messages_and_reports_have_one_name_for_one_thing() -> None:
    assert [
        f"{path.relative_to(ROOT)}:{line}: {word}"
        for path in SOURCES
        if path.relative_to(ROOT).parts[0] in {"models", "ocp", "compensator"}
        for line, text in messages(path)
        for word in other_names(text)
    ] == []


def test_templates_and_examples_have_one_name_for_one_thing() -> None:
    assert [f"{path.relative_to(ROOT)}: {word}" for path in SCENARIOS for word in other_names(text_of(path))] == []


def test_the_exported_code_has_one_name_for_one_thing() -> None:
    assert [
        f"{path.relative_to(ROOT)}: {word}"
        for path in EXPORTED
        for word in other_names(prose(text_of(path)) if ".md" in path.suffixes else comments(text_of(path)))
    ] == []


def test_the_glossary_names_every_compensator_as_reports_and_c_do() -> None:
    rows = re.findall(r"^\| `(\w+)` \| ([^|`]+) \| (.*?)\|$", text_of(GLOSSARY), re.MULTILINE)
    assert {name: label.strip() for name, label, _ in rows} == {each.name: each.label for each in COMPENSATORS}
    modules = {each.name: f"`<prefix>_{each.c_module.name}`" for each in COMPENSATORS if each.c_module}
    assert {name: module.split(",")[0].strip() for name, _, module in rows if module.strip()} == modules


@pytest.mark.parametrize("text", ["set-points", "the fidelity\nlevel", "Lever arms", "Static\nlaw"])
def test_other_names_are_found_across_lines_and_forms(text: str) -> None:
    assert other_names(text)


@pytest.mark.parametrize("text", ["quasi-static law", "_set_adhesion(x)", "leverage", "adhesion_N"])
def test_terms_and_code_are_no_other_names(text: str) -> None:
    assert other_names(text) == []


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
    ],
)
def test_house_words_are_found_across_lines_and_forms(text: str) -> None:
    assert len(refused(text)) == 1


@pytest.mark.parametrize("text", ["plays compose", "`told`", "leaves no profile", "\\(told\\)", "storytold", "toldest"])
def test_terms_code_and_other_words_are_not(text: str) -> None:
    assert refused(prose(text)) == []
