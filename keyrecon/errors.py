"""The one exception for what a user can mend."""


class KeyreconError(Exception):
    """What was found, then what would help; the command line prints it as one line."""
