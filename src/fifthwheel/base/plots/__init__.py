"""Plots as data: panels of lines, bands, points and guides, drawn by plotly or by matplotlib."""

from fifthwheel.base.plots.items import Area, Axis, Band, Bars, Guide, Item, Label, Line, Panel, Points, Span
from fifthwheel.base.plots.plot import Plot

__all__ = ["Area", "Axis", "Band", "Bars", "Guide", "Item", "Label", "Line", "Panel", "Plot", "Points", "Span"]
