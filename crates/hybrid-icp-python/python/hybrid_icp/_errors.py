"""Exceptions and warnings."""


class HybridIcpError(Exception):
    """Base class of all errors of this package."""


class InputError(HybridIcpError, ValueError):
    """An argument has the wrong shape, dtype, unit or value.

    The message has the value found and the value expected.
    """


class FileError(HybridIcpError, OSError):
    """A file cannot be read or written. The message names the file and the place in it."""


class InputWarning(UserWarning):
    """An argument is well-formed but implausible, such as units or frames that do not match."""


for _class in (HybridIcpError, InputError, FileError, InputWarning):
    _class.__module__ = "hybrid_icp"
del _class
