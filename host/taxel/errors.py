"""The base of every error that a user of the library may want to catch."""


class TaxelError(Exception):
    """Something that the user can act on. Its text is one line that names the file, port, board or field, and what to
    do.
    """
