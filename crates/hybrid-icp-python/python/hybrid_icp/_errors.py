"""What is raised and warned of."""


class HybridIcpError(Exception):
    """Base of all errors of this package."""


class InputError(HybridIcpError, ValueError):
    """What was passed has the wrong shape, dtype, unit or value; the message says what it is and what was expected."""


class FileError(HybridIcpError, OSError):
    """A file cannot be read or written; the message names it and the place in it."""


class InputWarning(UserWarning):
    """What was passed is well-formed but implausible: units or frames that do not go together."""


for _class in (HybridIcpError, InputError, FileError, InputWarning):
    _class.__module__ = "hybrid_icp"
del _class
