"""Results beside each other."""

from fifthwheel.app.workspace import Workspace


def build(workspace: Workspace) -> None:
    """Fill the page."""
