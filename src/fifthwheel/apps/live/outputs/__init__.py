"""Where states go to: frames on the bus, and files."""
