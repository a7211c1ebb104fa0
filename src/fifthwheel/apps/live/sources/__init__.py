"""Where frames come from: live buses, or a recorded trace."""
