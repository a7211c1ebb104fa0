"""The documentation site: `sphinx-build -W -b html docs docs/_build/html`."""

import os
import runpy
import sys
from pathlib import Path

import fifthwheel

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parent / "_extensions"))
runpy.run_path(str(Path(__file__).parent / "_figures"), run_name="__main__")

project = "fifthwheel"
author = "the fifthwheel authors"
project_copyright = f"2026, {author}"
release = version = fifthwheel.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_gallery.gen_gallery",
    "command_reference",
    "contents",
    "generated_tables",
    "mathml",
    "python_reference",
    "settings_reference",
]
exclude_patterns = ["_build", "_extensions", "_figures", "gallery/*.ipynb", "sg_execution_times.rst"]

myst_enable_extensions = ["dollarmath"]
myst_fence_as_directive = ["math"]  # the notation of code hosts for equations
myst_heading_anchors = 4

nb_execution_mode = "force"  # the notebooks have no outputs; an unchanged one is not read again
nb_execution_raise_on_error = True
nb_execution_timeout = 300

autodoc_typehints = "description"
autodoc_preserve_defaults = True
napoleon_numpy_docstring = False

default_role = "code"  # `name` in docstrings
smartquotes = False  # options such as --json keep their dashes

html_theme = "furo"
html_title = f"fifthwheel {release}"
html_math_renderer = "mathml"  # drawn by the browser, without scripts
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False

sphinx_gallery_conf = {
    "examples_dirs": "../examples/gallery",
    "gallery_dirs": "gallery",
    "image_scrapers": ("matplotlib", "plot_images.scrape"),
    "filename_pattern": r"\.py$",
    "within_subsection_order": "FileNameSortKey",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "remove_config_comments": True,
    "show_signature": False,
    "write_computation_times": False,
}
