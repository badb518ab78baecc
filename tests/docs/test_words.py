"""What users read is in the words of docs/glossary.md, and a line of the docs fits on a screen."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
GLOSSARY = ROOT / "docs/glossary.md"
PAGES = sorted(page for page in (*ROOT.glob("docs/**/*.md"), ROOT / "README.md", *ROOT.glob("sample_logs/*.md")))
LONGEST = 120


def table(heading: str) -> list[list[str]]:
    """The rows of the table with that first column."""
    text = GLOSSARY.read_text(encoding="utf-8")
    (rows,) = re.findall(rf"^\| {heading} \|.*\n\|[-|]+\n((?:\|.*\n)+)", text, flags=re.MULTILINE)
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in rows.splitlines()]


REPLACED = re.compile("|".join(rf"\b{re.escape(old.strip('`'))}\b" for old, _ in table("not")), re.IGNORECASE)


def texts(source: str) -> Iterator[tuple[int, str]]:
    """(line, text) of every string that may be a sentence, docstrings among them: names and keys have no space."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in (text := node.value.strip()):
            yield node.lineno, " ".join(re.sub(r"`[^`]*`|^\s*\w+ : ", "", text, flags=re.MULTILINE).split())


def test_the_glossary_has_forty_terms_in_order_each_with_what_the_field_says() -> None:
    rows = table("term")
    assert len(rows) >= 40
    assert [row for row in rows if len(row) != 3 or not all(row)] == []
    names = [row[0].lower() for row in rows]
    assert len(set(names)) == len(names)


def test_every_term_is_used() -> None:
    """A term that nobody meets explains nothing."""
    read = [page.read_text(encoding="utf-8") for page in PAGES if page != GLOSSARY]
    read += [path.read_text(encoding="utf-8") for path in (ROOT / "dsd_cli").rglob("*.py")]
    everything = " ".join(" ".join(read).split()).lower()
    assert [row[0] for row in table("term") if row[0].lower() not in everything] == []


@pytest.mark.parametrize("page", [page for page in PAGES if page != GLOSSARY], ids=lambda page: page.name)
def test_a_page_has_no_word_that_the_glossary_replaces(page: Path) -> None:
    text = " ".join(page.read_text(encoding="utf-8").split())
    assert [text[max(m.start() - 40, 0) : m.end() + 20] for m in REPLACED.finditer(text)] == []


@pytest.mark.parametrize("kind", ["json", "toml", "sh"])
def test_no_schema_config_or_script_has_one(kind: str) -> None:
    """Descriptions of the keys of results, comments of templates and samples, what the demo says."""
    files = [path for folder in ("dsd_cli", "sample_logs") for path in (ROOT / folder).rglob(f"*.{kind}")]
    assert files
    found = [f"{path.name}: {match[0]}" for path in files for match in REPLACED.finditer(path.read_text("utf-8"))]
    assert found == []


def test_no_message_help_or_docstring_has_one() -> None:
    found = []
    for path in sorted((ROOT / "dsd_cli").rglob("*.py")):
        for line, text in texts(path.read_text(encoding="utf-8")):
            found += [f"{path.relative_to(ROOT)}:{line}: {match[0]}" for match in REPLACED.finditer(text)]
    assert found == []


@pytest.mark.parametrize("page", [*PAGES, ROOT / "CHANGELOG.md"], ids=lambda page: page.name)
def test_no_line_of_prose_is_too_long(page: Path) -> None:
    """Rows of tables and what stands in code blocks cannot be broken."""
    lines = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL).splitlines()
    assert [line for line in lines if len(line) > LONGEST and not line.startswith(("|", "    "))] == []


def test_the_changelog_is_short() -> None:
    """What changed for a user, in at most 80 lines a version."""
    versions = re.split(r"^## ", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    assert [text.splitlines()[0] for text in versions if len(text.splitlines()) > 80] == []


def test_every_link_of_the_docs_leads_somewhere() -> None:
    broken = []
    for page in [*PAGES, ROOT / "CHANGELOG.md"]:
        for link in re.findall(r"\]\(([^)#\s]+)", re.sub(r"`[^`]*`", "", page.read_text(encoding="utf-8"))):
            if "://" not in link and not (page.parent / link).exists():
                broken.append(f"{page.relative_to(ROOT)}: {link}")
    assert broken == []
