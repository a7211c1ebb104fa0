"""What the logs can tell before an identification."""

from fifthwheel.app.workspace import Workspace


def build(workspace: Workspace) -> None:
    """Fill the page."""
