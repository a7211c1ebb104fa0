"""Expressions: linear solutions, derivatives through intermediate variables, and series in time."""
