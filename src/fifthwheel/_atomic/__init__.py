"""Files that appear complete or not at all, and folders of results that are replaced as a whole."""

from fifthwheel._atomic.files import atomic_write, reserved, write_json, write_text
from fifthwheel._atomic.locks import clean_up
from fifthwheel._atomic.results import (
    MANIFEST,
    file_digest,
    one_run,
    recorded_digests,
    recover,
    replaced_result,
    require_unused,
    result_folder,
)

__all__ = [
    "MANIFEST",
    "atomic_write",
    "clean_up",
    "file_digest",
    "one_run",
    "recorded_digests",
    "recover",
    "replaced_result",
    "require_unused",
    "reserved",
    "result_folder",
    "write_json",
    "write_text",
]
