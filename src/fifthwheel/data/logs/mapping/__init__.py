"""Proposal of a signal map: survey of a log, rules for names of channels, corrections by kinematics."""
