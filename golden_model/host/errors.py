"""What is said of input: the one exception for input that cannot be used, and warnings of what was made of the rest."""

import warnings


class InputError(Exception):
    """The user's input cannot be used. The message is one line that names the file or option and what to do.

    The command line prints it and exits with code 2; it is never raised for a fault of Lightloom's own.
    """

    def __init__(self, message: str) -> None:
        super().__init__(_one_line(message))


class InputWarning(UserWarning):
    """Something in the user's input was left out or changed. The message is one line that names the file and what.

    The command line prints it on stderr, once; in Python it is a warning like any other.
    """


def warn(message: str) -> None:
    """Says what was left out or changed."""
    warnings.warn(_one_line(message), InputWarning, stacklevel=3)


def _one_line(message: str) -> str:
    """What may hold names of files and from files, without line breaks and without what a terminal would obey."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in " ".join(message.splitlines()))
