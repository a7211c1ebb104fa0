"""What knows nothing of trucks: errors, settings, units, numbers as text, files, pages and plots, machine code."""
