"""The colours of Okabe and Ito, which people with a colour vision deficiency can distinguish."""

BLUE, VERMILLION, GREEN, ORANGE, PURPLE, SKY = "#0072B2", "#D55E00", "#009E73", "#E69F00", "#CC79A7", "#56A0D3"
GREY, DARK = "#8c8c8c", "#333333"
GRID = "#e8e8e8"

CYCLE = (BLUE, VERMILLION, GREEN, ORANGE, PURPLE, SKY, DARK)
"""Colours of the items of a panel that have none of their own, in this order."""


def rgb(colour: str) -> tuple[int, int, int]:
    """Red, green and blue, 0 to 255, of a colour such as "#0072B2"."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def rgba(colour: str, opacity: float) -> str:
    """A colour with its opacity as CSS writes it.

    >>> rgba("#0072B2", 0.18)
    'rgba(0,114,178,0.18)'
    """
    red, green, blue = rgb(colour)
    return f"rgba({red},{green},{blue},{opacity:g})"
