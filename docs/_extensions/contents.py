"""Pages for a code host become pages of the site: the navigation from the links of index.md, links to the gallery."""

import re
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

SECTION = re.compile(r"^## (.+?)$(.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)
PAGE = re.compile(r"\]\(([\w\-/]+)\.(?:md|rst|ipynb)\)")
OUTSIDE = re.compile(r"\]\(((?:\.\./)+(?:benchmarks/\w+|CHANGELOG)\.md)\)")
INDEX = re.compile(r"^<!-- index: (.+) -->$", re.MULTILINE)
SCRIPT = re.compile(r"\.\./examples/gallery/(\w+)\.(?:py|rst)\)")


def prepare(app: Sphinx, document: str, source: list[str]) -> None:
    """Lead links of gallery scripts to their pages and of benchmarks to downloads; add index entries and toctrees.

    The search finds an entry, `<!-- index: a term -->`, before all other places of the term.

    Each row of a table of index.md begins with a page of the navigation; the others of the row are below that page.
    """
    source[0] = INDEX.sub(lambda entry: f"```{{index}} ! {entry[1].replace(', ', ', ! ')}\n```", in_site(source[0]))
    sections = SECTION.findall(in_site((Path(app.srcdir) / "index.md").read_text(encoding="utf-8")))
    rows = {title: [found for line in text.splitlines() if (found := PAGE.findall(line))] for title, text in sections}
    if document == app.config.root_doc:
        for title, pages in rows.items():
            source[0] += toctree([first for first, *_ in pages], f":caption: {title}\n")
    for first, *below in (pages for section in rows.values() for pages in section):
        if document == first and below:
            source[0] += toctree([f"/{page}" for page in below])


def in_site(text: str) -> str:
    text = SCRIPT.sub(lambda link: f"gallery/{link[1].replace('GALLERY_HEADER', 'index')}.rst)", text)
    return OUTSIDE.sub(r"](path:\1)", text)


def toctree(pages: list[str], options: str = "") -> str:
    return f"\n```{{toctree}}\n:hidden:\n{options}\n" + "\n".join(pages) + "\n```\n"


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("source-read", prepare)
    return {"parallel_read_safe": True}
