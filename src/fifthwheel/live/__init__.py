"""The live node: frames of a bus to states and parameters, on-line or from a trace."""
