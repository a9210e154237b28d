"""What is said of input: the one exception for input that cannot be used, and warnings of what was made of the rest."""

import warnings


class InputError(Exception):
    """The user's input cannot be used. The message is one line that names the file or option and what to do.

    The command line prints it and exits with code 2; it is never raised for a fault of Lightloom's own.
    """

    def __init__(self, message: str) -> None:
        # Names in files may hold line breaks.
        super().__init__(" ".join(message.splitlines()))


class InputWarning(UserWarning):
    """Something in the user's input was left out or changed. The message is one line that names the file and what.

    The command line prints it on stderr, once; in Python it is a warning like any other.
    """


def warn(message: str) -> None:
    """Says what was left out or changed."""
    warnings.warn(" ".join(message.splitlines()), InputWarning, stacklevel=3)
