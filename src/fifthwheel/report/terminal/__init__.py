"""Results as tables on a terminal of 80 columns."""
