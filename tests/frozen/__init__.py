"""Results that a change of the structure must not change: compared bit for bit with those of another commit."""
