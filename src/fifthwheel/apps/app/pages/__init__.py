"""The pages, one module each, with `build(workspace)`."""
