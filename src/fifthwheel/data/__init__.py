"""From a log to a checked record: channels, records, checks, readers of logs."""
