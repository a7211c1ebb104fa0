"""CAN: frames decoded by the databases of the user and by J1939."""
