"""The signal map, with what the truck's kinematics predict for each signal."""

from fifthwheel.app.workspace import Workspace


def build(workspace: Workspace) -> None:
    """Fill the page."""
