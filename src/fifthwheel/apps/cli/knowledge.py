"""fifthwheel knowledge"""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fifthwheel.apps.cli import options, terminal
from fifthwheel.apps.cli.app import command, knowledge_app
from fifthwheel.base.atomic import one_run, replaced_result, reserved

if TYPE_CHECKING:
    from collections.abc import Callable

    from fifthwheel.base.pages import Document
    from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge

Result = Annotated[
    Path,
    typer.Argument(
        metavar="RESULT", help="Result folder of `fifthwheel identify`, or a knowledge.json.", show_default=False
    ),
]


@command(
    "fifthwheel knowledge show result",
    "fifthwheel knowledge show result --all",
    "fifthwheel knowledge show merged.json --json",
    of=knowledge_app,
)
def show(
    result: Result,
    everything: Annotated[
        bool, typer.Option("--all", help="Also uncertain numbers of the vehicle file and errors of sensors.")
    ] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Print the estimates from all logs of a truck: value, sigma, and the truck, trailer or load that each belongs to.

    These are what the next identification begins with. A unit "prior sigma" stands for standard deviations of the
    prior, of an unknown that moves several numbers of the vehicle file.
    """
    contents, document = _estimates(_read(result), everything=everything)
    terminal.print_result(contents, document, {}, as_json=as_json)


@command(
    "fifthwheel knowledge history result",
    "fifthwheel knowledge history result --json",
    of=knowledge_app,
)
def history(result: Result, as_json: options.JsonOption = False) -> None:
    """Print the logs in the order of their dates: the sigma of each parameter before and after each log.

    A remark says what changed before a log, such as its tyres; why a log is not used; and the doubts about it.
    """
    from fifthwheel.estimate.identify.knowledge.history import history as entries_of
    from fifthwheel.results.report.knowledge import history_document

    entries = entries_of(_read(result))
    contents = {"logs": [entry.as_dict() for entry in entries]}
    terminal.print_result(contents, partial(history_document, entries), {}, as_json=as_json)


@command(
    "fifthwheel knowledge forget result 'run 3'",
    "fifthwheel knowledge forget result bend -o without_bend.json",
    of=knowledge_app,
)
def forget(
    result: Result,
    log: Annotated[str, typer.Argument(help="Name of the log, or the beginning of its digest.", show_default=False)],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File or folder to write to. Default: in place.")
    ] = None,
    force: options.ForceFileOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Remove a log from the knowledge; the other logs are not identified again.

    Logs that were set aside because they contradict the removed one are used again. Of a result folder only
    knowledge.json changes; the other files are those of the last `fifthwheel identify` until it runs again.
    """
    from fifthwheel.base.errors import printable
    from fifthwheel.estimate.identify.knowledge.storage import knowledge_file

    source = knowledge_file(result)
    target = source if out is None else _target(out)
    if target == source:
        with replaced_result(target) as temporary:  # no other command writes to the folder meanwhile
            knowledge = _read(result)
            left = knowledge.without(log)
            left.save(temporary)
    else:
        knowledge = _read(result)
        left = knowledge.without(log)
        _write(left, target, force=force)
    aside = {other.digest for other in knowledge.logs if other.set_aside}
    again = [other.name for other in left.used if other.digest in aside]
    contents, document = _estimates(left)
    terminal.print_result({**contents, "used_again": again}, document, {target.name: target}, as_json=as_json)
    if again and not as_json:
        typer.echo(f"Used again: {printable(', '.join(again))}")
    if target.with_name("identification.json").exists() and not as_json:
        typer.echo("identification.json, vehicle.toml and report.html are those of the last identify: run it again.")


@command(
    "fifthwheel knowledge merge monday tuesday -o merged.json",
    "fifthwheel knowledge merge monday tuesday other.json -o truck",
    "fifthwheel knowledge merge result learned.json -o truck",
    of=knowledge_app,
)
def merge(
    results: Annotated[
        list[Path],
        typer.Argument(
            metavar="RESULT...",
            help="Result folders of one truck, knowledge.json of them, or files of `fifthwheel live --learn`.",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(
            "--out", "-o", help="File that ends with .json, or folder for knowledge.json.", show_default=False
        ),
    ],
    force: options.ForceFileOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Join the logs of several results of one truck; a log that several contain counts once.

    Begin with it by `fifthwheel identify run.csv --vehicle truck.toml --knowledge merged.json`.
    """
    from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge

    merged = Knowledge()
    for result in results:
        merged = merged.merged(_read(result))
    contents, document = _estimates(merged)
    target = _target(out)
    _write(merged, target, force=force)
    contents["logs"] = [log.name for log in merged.logs]
    terminal.print_result(contents, document, {target.name: target}, as_json=as_json)


def _read(result: Path) -> "Knowledge":
    from fifthwheel.apps.workflow.inputs import read_knowledge
    from fifthwheel.base.errors import SignalError
    from fifthwheel.estimate.identify.knowledge.storage import knowledge_file

    with one_run(knowledge_file(result)):
        knowledge = read_knowledge(result)
    if not knowledge.used:
        raise SignalError(f"{result}: has no log that is used; give another result")
    return knowledge


def _estimates(knowledge: "Knowledge", *, everything: bool = False) -> "tuple[dict[str, Any], Callable[[], Document]]":
    """The logs that are used and the estimates from them, and the same for people."""
    from fifthwheel.estimate.identify.knowledge.history import shared_estimates
    from fifthwheel.results.report.knowledge import knowledge_document

    estimates = shared_estimates(knowledge)
    shown = [estimate.as_dict() for estimate in estimates if everything or estimate.estimated]
    contents = {"logs": [log.name for log in knowledge.used], "estimates": shown}
    return contents, partial(knowledge_document, estimates, len(knowledge.used), everything=everything)


def _target(out: Path) -> Path:
    """The file to write: `out`, or knowledge.json in it."""
    from fifthwheel.estimate.identify.knowledge.storage import KNOWLEDGE

    return out if out.suffix == ".json" and not out.is_dir() else out / KNOWLEDGE


def _write(knowledge: "Knowledge", path: Path, *, force: bool) -> None:
    """Write the file; that of a result folder with its digest in run.json."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with reserved(path, force=force), replaced_result(path) as temporary:
        knowledge.save(temporary)
