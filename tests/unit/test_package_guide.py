"""Tests of the guide in packages: pages of the docs as HTML whose links work without the checkout."""

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from tools.packages.guide import START, to_html, write_guide


class Parsed(HTMLParser):
    """Addresses and anchors of a document; raises AssertionError if elements are not nested."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links, self.anchors, self._open = [], set(), []
        self.feed(text)
        assert not self._open

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        self.links += [values["href"]] if "href" in values else []
        self.anchors |= {values["id"]} if "id" in values else set()
        if tag != "meta":
            self._open.append(tag)

    def handle_endtag(self, tag):
        assert self._open.pop() == tag


@pytest.fixture(scope="module")
def guide(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("guide")
    write_guide(folder)
    return folder


def test_every_link_of_the_guide_leads_to_a_page_and_heading(guide):
    """All pages are reached from the first one."""
    pages = {path: Parsed(path.read_text(encoding="utf-8")) for path in guide.rglob("*.html")}
    assert guide / START in pages
    for path, page in pages.items():
        for link in (link for link in page.links if "://" not in link):
            target, _, anchor = link.partition("#")
            linked = (path.parent / target).resolve() if target else path
            assert linked in pages, (path, link)
            assert not anchor or anchor in pages[linked].anchors, (path, link)
    reached = {(guide / START).parent / link for link in pages[guide / START].links if "#" not in link}
    assert {path.resolve() for path in reached if "://" not in str(path)} >= set(pages)


def test_no_marks_of_markdown_are_left(guide):
    """Outside of code there are no links, tables or emphasis that were not converted."""
    for path in guide.rglob("*.html"):
        text = re.sub(r"<code>.*?</code>", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
        assert not re.search(r"\]\(|^\||\*\*|```|\0", text, re.MULTILINE), path


def test_markdown_becomes_html(tmp_path):
    """Text is escaped, code stays as it is, and links to pages that are not there become text."""
    page, other = tmp_path / "a.md", tmp_path / "b.md"
    text = (
        "# A *b*\n\nOne `x | **y**` & [two](b.md#c), [three](c.md).\n\n| H |\n|---|\n| 1 < 2 |\n\n"
        "1. first\n   goes on\n2. second\n\n```sh\n# no heading\n```\n"
    )
    made = to_html(text, page, [page, other])
    assert made == (
        '<h1 id="a-b">A <em>b</em></h1>\n'
        '<p>One <code>x | **y**</code> &amp; <a href="b.html#c">two</a>, three.</p>\n'
        "<table><tr><th>H</th></tr><tr><td>1 &lt; 2</td></tr></table>\n"
        "<ol><li>first goes on</li><li>second</li></ol>\n"
        "<pre><code># no heading\n</code></pre>"
    )
