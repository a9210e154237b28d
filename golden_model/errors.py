"""The one exception for bad input."""


class InputError(Exception):
    """The user's input cannot be used. The message is one line that names the file or option and what to do.

    The command line prints it and exits with code 2; it is never raised for a fault of Lightloom's own.
    """
