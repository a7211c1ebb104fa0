"""Files that appear complete or not at all, and folders of results that are replaced as a whole."""

from typing import TYPE_CHECKING

from fifthwheel.base.lazy import lazy_names

if TYPE_CHECKING:
    from fifthwheel.base.atomic.files import atomic_write as atomic_write
    from fifthwheel.base.atomic.files import reserved as reserved
    from fifthwheel.base.atomic.files import write_json as write_json
    from fifthwheel.base.atomic.files import write_text as write_text
    from fifthwheel.base.atomic.locks import clean_up as clean_up
    from fifthwheel.base.atomic.results import MANIFEST as MANIFEST
    from fifthwheel.base.atomic.results import file_digest as file_digest
    from fifthwheel.base.atomic.results import one_run as one_run
    from fifthwheel.base.atomic.results import recorded_digests as recorded_digests
    from fifthwheel.base.atomic.results import recover as recover
    from fifthwheel.base.atomic.results import replaced_result as replaced_result
    from fifthwheel.base.atomic.results import require_unused as require_unused
    from fifthwheel.base.atomic.results import result_folder as result_folder
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__)
