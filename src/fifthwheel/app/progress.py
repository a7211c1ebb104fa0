"""The progress of a job in a page."""

from collections.abc import Callable

from nicegui import ui

from fifthwheel.app import jobs

POLL = 0.3
"""s"""


def show(key: str, on_end: Callable[[jobs.Job], object]) -> None:
    """Show a job while it runs, with a button that cancels it.

    Args:
        key: of the job; where there is none, or it has ended, nothing is shown.
        on_end: called once when a job ends that was running when the page was built.
    """
    job = jobs.get(key)
    if job is None or not job.running:
        return
    with ui.row().classes("items-center w-full no-wrap") as row:
        bar = ui.linear_progress(show_value=False).props('aria-label="Progress" role=progressbar').classes("col")
        text = ui.label().props("role=status aria-live=polite")
        ui.button("Cancel", on_click=job.cancel).props("outline dense")

    def update() -> None:
        if not job.running:
            timer.cancel()
            row.delete()
            on_end(job)
            return
        bar.props(
            "indeterminate" if job.fraction is None else "", remove="" if job.fraction is None else "indeterminate"
        )
        bar.value = job.fraction or 0.0
        text.text = job.title if job.fraction is None else f"{job.title} {job.fraction:.0%}"

    timer = ui.timer(POLL, update)
