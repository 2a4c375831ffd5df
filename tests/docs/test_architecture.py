"""docs/ names files and functions that exist, and keeps to the rules of prose."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOCS = sorted((ROOT / "docs").glob("*.md"))
WALKS = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8").split("## Three walks")[1]
WALKS = WALKS.split("## Glossary")[0]
LINK = re.compile(r"\[[^\]]+\]\((?!http)([^)#]+)\)")
LONGEST = 25  # words of a sentence


def _steps() -> list[str]:
    """The numbered items of the walks, each with its continuation lines."""
    return [step.replace("\n", " ") for step in re.split(r"^\d+\. ", WALKS, flags=re.MULTILINE)[1:]]


def _named(step: str) -> list[tuple[str, str]]:
    """Every `function()` of a step with the files that the step links."""
    files = " ".join(LINK.findall(step))
    return [(files, name) for name in re.findall(r"`(\w+)\(\)`", step)]


def _prose(page: Path) -> list[str]:
    """The sentences of a page: paragraphs and list items, without code, tables and headings."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    lines = [line for line in text.splitlines() if not line.startswith(("|", "#"))]
    blocks = re.split(r"\n\s*\n|\n(?=\s*(?:\d+\.|-) )", "\n".join(lines))
    plain = [LINK.sub("link", block).replace("\n", " ") for block in blocks]
    plain = [re.sub(r"`[^`]*`", "code", re.sub(r"^\s*(\d+\.|-) ", "", block)) for block in plain]
    return [sentence for block in plain for sentence in re.split(r"(?<=[.?!])\s+", block) if sentence.strip()]


@pytest.mark.parametrize("page", DOCS, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    targets = LINK.findall(page.read_text(encoding="utf-8"))
    assert not [target for target in targets if not (page.parent / target).exists()]


def test_there_are_three_walks() -> None:
    assert WALKS.count("### ") == 3
    assert len(_steps()) >= 20
    assert all(LINK.search(step) for step in _steps())


@pytest.mark.parametrize(("files", "name"), [pair for step in _steps() for pair in _named(step)])
def test_functions_of_the_walks_exist(files: str, name: str) -> None:
    texts = [(ROOT / "docs" / file).read_text(encoding="utf-8") for file in files.split()]
    assert any(re.search(rf"^\s*(def|class) {name}\b", text, flags=re.MULTILINE) for text in texts)


def test_folders_of_the_map_exist() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`[^|]+) \|", page, flags=re.MULTILINE)
    folders = [name for row in rows for name in re.findall(r"`([\w/]+/)`", row)]
    assert len(folders) > 20
    for folder in folders:
        assert (ROOT / folder).is_dir() or (ROOT / "renderer" / folder).is_dir(), folder


@pytest.mark.parametrize("page", DOCS, ids=lambda page: page.name)
def test_files_that_a_page_names_exist(page: Path) -> None:
    """Paths in code marks, relative to the root, to `tests/` or to `docs/`; `*` matches any name."""
    named = re.findall(r"`([\w*./-]+/[\w*.-]+\.(?:py|pbrt|toml))`", page.read_text(encoding="utf-8"))
    missing = [name for name in named if not (list(ROOT.glob(name)) or list((ROOT / "tests").glob(name)))]
    assert not missing


@pytest.mark.parametrize("page", DOCS, ids=lambda page: page.name)
def test_sentences_are_short(page: Path) -> None:
    long = [sentence for sentence in _prose(page) if len(sentence.split()) > LONGEST]
    assert not long
