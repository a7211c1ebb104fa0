"""A vehicle file with other numbers: its comments and its order stay."""

import re
from collections.abc import Iterable
from typing import Any

from fifthwheel.truck import toml_format
from fifthwheel.truck.quantities import unit_of
from fifthwheel.truck.vehicle import Vehicle


def edited(text: str, vehicle: Vehicle) -> str:
    """The text of a vehicle file with the numbers, standard deviations and source of another vehicle where they differ.

    If the text has other units, axle groups or payloads, the result is `vehicle.to_toml()`, without comments.
    """
    before = Vehicle.loads(text)
    if before.parameters().keys() != vehicle.parameters().keys() or vehicle.is_exact != before.is_exact:
        return vehicle.to_toml()
    changed = [
        path
        for path, value in vehicle.parameters().items()
        if (value, vehicle.stated.get(path)) != (before.parameters()[path], before.stated.get(path))
    ]
    result = with_numbers(text, vehicle, changed)
    return result if Vehicle.loads(result) == vehicle else vehicle.to_toml()


def with_numbers(text: str, vehicle: Vehicle, paths: Iterable[str]) -> str:
    """The text of a vehicle file with the name, the source and the numbers at `paths` of another vehicle of the same
    units; numbers that the classes give follow from them."""
    import tomlkit  # slow to import

    document = tomlkit.parse(text)
    document["name"] = vehicle.name
    if vehicle.source:
        document["source"] = vehicle.source
    values, locations, stated = vehicle.parameters(), vehicle.locations(), {} if vehicle.is_exact else vehicle.stated
    for path in paths:
        table: Any = document
        comment: Any = None
        *keys, last = locations[path]
        name = str(last)
        for key in keys:
            if key == "axles" and "axles" not in table:  # a single axle: its position stands in the group
                break
            comment = _comment_behind(table, key)
            table = table[toml_format.FILE_KEYS.get(key, key) if isinstance(key, str) else key]
        _replace(table, name, toml_format.text(values[path], unit_of(path), stated.get(path)), comment)
        if path in vehicle.assumed:
            document.setdefault("assumed", tomlkit.table())[path] = vehicle.assumed[path]
        elif path in document.get("assumed", {}):
            del document["assumed"][path]
    return tomlkit.dumps(document)


def _comment_behind(array: Any, key: str | int) -> Any:
    """The comment behind an inline table in an array; None where there is none."""
    from tomlkit.items import InlineTable

    groups = getattr(array, "_value", ()) if isinstance(key, int) else ()  # tomlkit has no public access to it
    tables = [group for group in groups if isinstance(group.value, InlineTable)]
    return tables[int(key)].comment if tables else None


def _replace(table: Any, key: str, text: str, behind: Any = None) -> None:
    """Give a key another text; its comment, or that `behind` an inline table, keeps the former number as a source."""
    import tomlkit
    from tomlkit.items import Comment, InlineTable

    item = tomlkit.string(text)
    if key in table:
        former = table.item(key)
        comment = (behind or former).trivia.comment.removeprefix("#").strip()
        was = f"was {former.as_string()}" + (f": {comment}" if comment else "")
        if behind:
            behind.trivia.comment = f"# {was}"
        elif not isinstance(table, InlineTable):
            item.comment(was)
        table[key] = item
        return
    for name, assumed in getattr(getattr(table, "value", table), "body", ()):
        words = assumed.trivia.comment.removeprefix("#").strip() if isinstance(assumed, Comment) else ""
        if name is None and (found := re.fullmatch(rf"{key} = (\"[^\"]*\")\s*(?:#\s*(.*))?", words)):
            assumed.trivia.indent = assumed.trivia.comment = assumed.trivia.trail = ""
            item.comment(f"was {found[1]}, assumed" + (f": {found[2]}" if found[2] else ""))
            break
    table[key] = item
