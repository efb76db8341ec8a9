"""Tests that every relative link of the documentation leads to a file and, with an anchor, to a heading."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob(".github/*.md")])
_LINK = re.compile(r"\]\(([^)\s]+)\)")
_CODE = re.compile(r"^```.*?^```$|`[^`\n]*`", re.MULTILINE | re.DOTALL)


def _anchors(page: Path) -> set[str]:
    """Return the anchors that Git hosting sites give to the headings of a page."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def _problems(page: Path) -> list[str]:
    """Return the links of a page whose file or heading does not exist."""
    found = []
    for target in _LINK.findall(_CODE.sub("", page.read_text(encoding="utf-8"))):
        path, _, anchor = target.partition("#")
        if "://" in path:
            continue
        linked = (page.parent / path).resolve() if path else page
        if not linked.exists() or (anchor and anchor not in _anchors(linked)):
            found.append(target)
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_to_files(page):
    """A link that leads nowhere is named with its page."""
    assert _problems(page) == []


def test_a_wrong_link_is_found(tmp_path):
    """A missing file and a missing heading are reported; code, web pages and correct links are not."""
    (tmp_path / "there.md").write_text("# A heading, with *marks*\n")
    page = tmp_path / "page.md"
    page.write_text(
        "[a](there.md) [b](there.md#a-heading-with-marks) [c](missing.md) [d](there.md#other)\n"
        "`[e](code.md)` [f](https://example.org/x) [g](#own)\n\n## Own\n"
    )
    assert _problems(page) == ["missing.md", "there.md#other"]
