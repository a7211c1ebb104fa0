"""The vehicle file as a form."""

from fifthwheel.app.workspace import Workspace


def build(workspace: Workspace) -> None:
    """Fill the page."""
