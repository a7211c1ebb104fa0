"""Pages for a code host become pages of the site: the navigation from the links of index.md, links to the gallery."""

import re
from typing import Any

from sphinx.application import Sphinx

SECTION = re.compile(r"^## (.+?)$(.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)
PAGE = re.compile(r"\]\(([\w\-/]+)\.(?:md|rst|ipynb)\)")
OUTSIDE = re.compile(r"\]\(((?:\.\./)+(?:benchmarks/\w+|CHANGELOG)\.md)\)")
SCRIPT = re.compile(r"\.\./examples/gallery/(\w+)\.(?:py|rst)\)")


def prepare(app: Sphinx, document: str, source: list[str]) -> None:
    """Lead links of gallery scripts to their pages and of benchmarks to downloads; add hidden toctrees to index.md."""
    source[0] = SCRIPT.sub(lambda link: f"gallery/{link[1].replace('GALLERY_HEADER', 'index')}.rst)", source[0])
    source[0] = OUTSIDE.sub(r"](path:\1)", source[0])
    if document == app.config.root_doc:
        for title, text in SECTION.findall(source[0]):
            if pages := list(dict.fromkeys(PAGE.findall(text))):
                source[0] += f"\n```{{toctree}}\n:hidden:\n:caption: {title}\n\n" + "\n".join(pages) + "\n```\n"


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("source-read", prepare)
    return {"parallel_read_safe": True}
