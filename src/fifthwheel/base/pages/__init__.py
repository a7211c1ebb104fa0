"""A document as data: a title and blocks, in reading order.

Texts are plain; each renderer escapes them. What has something to show makes a `Document`, usually from a generator of
blocks: `html` writes it as a page or for a notebook, `terminal` prints it, the workbench has a renderer of its own.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from fifthwheel.base.plots import Plot


class Markup(str):
    """HTML, for what no other block can show; a terminal leaves it out."""

    __slots__ = ()


class Code(str):
    """The path of a parameter, signal or file; it may break after a dot."""

    __slots__ = ()


@dataclass(frozen=True)
class Mark:
    """A word with a severity, such as a verdict."""

    text: str
    kind: str
    """Its colour: the value of a `Verdict`, or "plain"."""
    symbol: str = ""
    """In front of the word, on a page."""
    row: Literal["", "off", "warn"] = ""
    """Colour of its row on a page: grey for what is no result, or a warning."""


@dataclass(frozen=True)
class Hinted:
    """Words with a hint that a page shows under the cursor, such as the path of a parameter."""

    text: str
    hint: str


Cell = str | Mark | Hinted


class TableColumn(NamedTuple):
    """A column of a table."""

    head: str
    style: str = ""
    """Words: "n" aligns to the right, "w" does not break, "wide" is left out on a narrow screen of the workbench. On a
    narrow page a row becomes a card: there "name" and "full" have their own line, and "main" is bold."""
    label: str = ""
    """Before the cell on a card, which has no head."""

    @property
    def is_number(self) -> bool:
        """Whether it is aligned to the right."""
        return "n" in self.style.split()


def column(text: str) -> TableColumn:
    """A column from "head|style|label", of which the head may be alone; a ">" after it stands for the style "n".

    A number that is not "main" has its head as label.
    """
    head, style, label = [*text.split("|"), "", ""][:3]
    if head.endswith(">"):
        head, label = head[:-1], label or ("" if "main" in style else f"{head[:-1]}: ")
        style = f"n {style}".rstrip()
    return TableColumn(head, style, label)


@dataclass(frozen=True)
class Table:
    """Rows of cells."""

    heads: Sequence[str | TableColumn]
    """A text as of `column`; a `TableColumn` for a head that may be any text."""
    rows: Sequence[Sequence[Cell]]
    label: str = ""
    """For screen readers."""

    @property
    def columns(self) -> list[TableColumn]:
        """The columns, from the heads."""
        return [column(head) if isinstance(head, str) else head for head in self.heads]

    def lines(self) -> list[str]:
        """Heads and rows as texts with aligned columns."""
        texts = [[c.head for c in self.columns], *[list(map(plain, row)) for row in self.rows]]
        widths = [max(map(len, cells)) for cells in zip(*texts, strict=True)]
        aligned = [str.rjust if c.is_number else str.ljust for c in self.columns]
        return [
            "  ".join(align(cell, width) for align, cell, width in zip(aligned, row, widths, strict=True)).rstrip()
            for row in texts
        ]


@dataclass(frozen=True)
class Heading:
    """A heading; with a key it begins a section, to which links lead, without a key a part of a section."""

    title: str
    key: str = ""
    badge: str = ""


@dataclass(frozen=True)
class Paragraph:
    """A text."""

    text: str


class Hint(Paragraph):
    """A text that explains what follows, or what to do; less prominent than a paragraph."""


@dataclass(frozen=True)
class Items:
    """A list of sentences; nothing if there is none."""

    lines: Sequence[str]
    title: str = ""
    ordered: bool = False


@dataclass(frozen=True)
class Headline:
    """The result in one sentence, with lists beside each other in the same box of a page."""

    text: str
    good: bool = True
    columns: "Sequence[Sequence[Block]]" = ()


@dataclass(frozen=True)
class Values:
    """Values by their names."""

    values: Mapping[str, object]


@dataclass(frozen=True)
class Verbatim:
    """A text as it is, such as that of a file."""

    text: str


@dataclass(frozen=True)
class CaptionedPlot:
    """A plot with its caption."""

    name: str
    plot: Plot
    group: str
    """Plots of one group zoom together, and have one cursor."""
    path: tuple[str, str, str]
    """Log, section, and signal or parameter: title and place of an image of it."""
    text: str = ""
    """Of the caption, after the name."""
    note: str = ""
    """Below the caption."""
    small: bool = False
    """One of three in a row."""

    @property
    def size(self) -> str:
        """ "small", "tall" for two panels one above the other or a drawing to scale, "wide" for more, or ""."""
        panels = self.plot.panels
        return "small" if self.small else "wide" if len(panels) > 2 else "tall" * (len(panels) > 1 or panels[0].equal)


@dataclass(frozen=True)
class Plots:
    """Plots side by side; a terminal leaves them out."""

    plots: Sequence[CaptionedPlot]


@dataclass(frozen=True)
class Folded:
    """Blocks that are folded away on a page below their summary."""

    summary: str
    blocks: "Sequence[Block]"
    detail: str = ""
    """A sentence after the summary."""
    key: str = ""
    """To which links lead."""


@dataclass(frozen=True)
class Beside:
    """Blocks beside each other, where a page is wide enough."""

    blocks: "Sequence[Block]"


Block = Headline | Heading | Paragraph | Items | Table | Values | Verbatim | Plots | Folded | Beside | Markup


def folded(section: "Iterable[Block]") -> "Iterator[Folded]":
    """A section, which begins with its heading, folded away; nothing without blocks."""
    match list(section):
        case [Heading() as head, *blocks]:
            yield Folded(head.title, blocks, key=head.key)


@dataclass(frozen=True)
class Document:
    """What a reader sees, from the title on."""

    title: str
    blocks: Sequence[Block]
    subtitle: str = ""
    appendix: Sequence[Folded] = ()
    """What a page has folded away at its end; a terminal leaves it out."""
    name: str = ""
    """Of the result, which a page shows behind the title."""
    sheet: bool = False
    """Whether a page is for one sheet of A4."""

    def __str__(self) -> str:
        """Title, tables and lists as text."""
        texts = [self.title]
        for block in self.blocks:
            match block:
                case Table(rows=rows) if rows:
                    texts.append("\n".join(block.lines()))
                case Items(lines=lines) if lines:
                    texts.append("\n".join(f"- {line}" for line in lines))
                case Paragraph():
                    texts.append(block.text)
        return "\n\n".join(texts)


def plain(cell: Cell) -> str:
    """A cell as text; "" for HTML."""
    return cell.text if isinstance(cell, Mark | Hinted) else "" if isinstance(cell, Markup) else cell
