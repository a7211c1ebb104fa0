"""The steps from logs to results, as functions of data: every front end calls these and contains no estimation."""
