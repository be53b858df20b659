"""What the bench says when it cannot go on."""


class BrakebenchError(Exception):
    """An error a person can act on: the message says what, where, expected, got, and what to do.

    Attributes
    ----------
    exit_code : what the command line returns: 2 wrong use or input, 3 the bench broke.
    """

    exit_code = 2
