"""The logs of the workspace: what they contain, plots of their channels, and windows that are left out."""

from fifthwheel.app.workspace import Workspace


def build(workspace: Workspace) -> None:
    """Fill the page."""
