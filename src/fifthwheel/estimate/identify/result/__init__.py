"""The result of an identification, with its display and its files."""
