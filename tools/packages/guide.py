"""The guide in a package: pages of docs/ as HTML, which a browser opens without a network."""

from __future__ import annotations

import html
import os
import re
from pathlib import Path

from tools.headless import ROOT

#: Folders of docs/ whose pages a user needs. Links to other pages become plain text.
FOLDERS = ("user", "reference", "engines")

#: First page.
START = Path("user", "guide.html")

_STYLE = (
    "body{max-width:50em;margin:2em auto;padding:0 1em;font:16px/1.5 sans-serif;color:#222}"
    "table{border-collapse:collapse}"
    "td,th{border:1px solid #ccc;padding:.3em .6em;text-align:left;vertical-align:top}"
    "pre{background:#f4f4f4;padding:.8em;overflow:auto}nav{color:#666}"
)


def write_guide(target: Path) -> None:
    """Write the pages into a folder, in the folders of docs/; pictures stay in the checkout."""
    docs = ROOT / "docs"
    pages = [page for folder in FOLDERS for page in sorted((docs / folder).glob("*.md"))]
    for page in pages:
        path = target / page.relative_to(docs).with_suffix(".html")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(_document(page, pages), encoding="utf-8", newline="\n")


def _document(page: Path, pages: list[Path]) -> str:
    """Return the HTML document of a page, with links to all others."""
    text = page.read_text(encoding="utf-8")
    title = text.partition("\n")[0].lstrip("# ")
    menu = " · ".join(
        f'<a href="{_relative(other, page)}">{html.escape(_title(other))}</a>' for other in pages
    )
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}</title>'
        f"<style>{_STYLE}</style></head>\n<body><nav>{menu}</nav>\n{to_html(text, page, pages)}"
        "</body></html>\n"
    )


def _title(page: Path) -> str:
    return page.read_text(encoding="utf-8").partition("\n")[0].lstrip("# ")


def _relative(page: Path, start: Path) -> str:
    """Return the address of the HTML file of a page, seen from another page."""
    return Path(os.path.relpath(page.with_suffix(".html"), start.parent)).as_posix()


def to_html(text: str, page: Path, pages: list[Path]) -> str:
    """Return the HTML of Markdown as the docs use it: headings, paragraphs, lists, tables, code.

    page:   its file, from which links start
    pages:  files that have an HTML page too
    """
    kept: list[str] = []

    def keep(match: re.Match) -> str:
        kept.append(f"<pre><code>{html.escape(match[1])}</code></pre>")
        return f"\n\n\0{len(kept) - 1}\0\n\n"

    text = re.sub(r"^```.*?\n(.*?)^```$", keep, text, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    blocks = (block.strip("\n") for block in re.split(r"\n\s*\n", text.strip()))
    return "\n".join(_block(block, kept, page, pages) for block in blocks)


def _block(block: str, kept: list[str], page: Path, pages: list[Path]) -> str:
    """Return the HTML of one block between empty lines."""
    first = block.lstrip()
    if found := re.fullmatch(r"\0(\d+)\0", first):
        return kept[int(found[1])]
    if found := re.match(r"(#+) (.*)", first):
        level, title = len(found[1]), found[2]
        return f'<h{level} id="{_anchor(title)}">{_inline(title, page, pages)}</h{level}>'
    if first.startswith("|"):
        return _table(first.splitlines(), page, pages)
    if re.match(r"([-*]|\d+\.) ", first):
        return _list(block, page, pages)
    if block.startswith("    "):
        return f"<pre><code>{html.escape(block)}</code></pre>"
    return f"<p>{_inline(' '.join(block.split()), page, pages)}</p>"


def _anchor(title: str) -> str:
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")


def _table(lines: list[str], page: Path, pages: list[Path]) -> str:
    """Return a table: a line of titles, a line of dashes, and rows."""
    rows = []
    for number, line in enumerate(lines):
        if number == 1:
            continue
        tag = "th" if number == 0 else "td"
        cells = (
            f"<{tag}>{_inline(cell.strip(), page, pages)}</{tag}>" for cell in line.strip("| ").split("|")
        )
        rows.append(f"<tr>{''.join(cells)}</tr>")
    return f"<table>{''.join(rows)}</table>"


def _list(block: str, page: Path, pages: list[Path]) -> str:
    """Return a list; items of inner lists are indented further, and become items of the same list."""
    items = re.split(r"^\s*(?:[-*]|\d+\.) ", block, flags=re.MULTILINE)[1:]
    tag = "ul" if re.match(r"\s*[-*]", block) else "ol"
    body = "".join(f"<li>{_inline(' '.join(item.split()), page, pages)}</li>" for item in items)
    return f"<{tag}>{body}</{tag}>"


def _inline(text: str, page: Path, pages: list[Path]) -> str:
    """Return the HTML of text with code, emphasis, links and pictures, of which the titles stay."""
    codes: list[str] = []

    def keep(match: re.Match) -> str:
        codes.append(f"<code>{html.escape(match[1])}</code>")
        return f"\0{len(codes) - 1}\0"

    text = html.escape(re.sub(r"`([^`]+)`", keep, text), quote=False)
    text = re.sub(r"!\[([^\]]*)\]\([^)]*\)", r"<em>\1</em>", text)
    text = re.sub(r"\[([^\]]*)\]\(([^)]*)\)", lambda match: _link(match[1], match[2], page, pages), text)
    text = re.sub(r"\*\*(.+?)\*\*", r"<strong>\1</strong>", text)
    text = re.sub(r"\*(.+?)\*", r"<em>\1</em>", text)
    return re.sub(r"\0(\d+)\0", lambda match: codes[int(match[1])], text)


def _link(title: str, target: str, page: Path, pages: list[Path]) -> str:
    """Return a link to a page of the guide, to a heading or to the web; any other is plain text."""
    path, mark, anchor = target.partition("#")
    if "://" in path:
        return f'<a href="{html.escape(target)}">{title}</a>'
    linked = (page.parent / path).resolve() if path else page
    if linked not in pages:
        return title
    address = _relative(linked, page) if path else ""
    return f'<a href="{address}{mark}{anchor}">{title}</a>'
