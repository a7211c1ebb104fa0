"""What fifthwheel raises: one family, all of it under ValueError, each message with the signal and the cure."""


class FifthwheelError(ValueError):
    """Base of every error that a user's input can cause."""


class VehicleError(FifthwheelError):
    """A vehicle description that cannot be: an unknown key, a unit that does not fit, an impossible number."""


class SignalError(FifthwheelError):
    """A log, or one signal of it, that cannot be used as it is."""
