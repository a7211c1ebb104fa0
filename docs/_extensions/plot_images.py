"""Pictures of the gallery from `fifthwheel.Plot`, in addition to those of pyplot."""

from typing import Any

from sphinx_gallery.scrapers import figure_rst

from fifthwheel import Plot


def scrape(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Save every plot that the block of a script has made; the signature is that of sphinx-gallery."""
    code = block[1]
    names = [name for name, value in block_vars["example_globals"].items() if isinstance(value, Plot)]
    paths = []
    for name in names:
        if f"{name} = " in code:
            path = next(block_vars["image_path_iterator"])
            block_vars["example_globals"][name].save(path)
            paths.append(path)
    return figure_rst(paths, gallery_conf["src_dir"])
