"""Loads the libraries of FMUs with fmpy, also those whose functions have a prefix, as in MODEL_fmi3DoStep.

The standard has this prefix for FMUs in source form, but some libraries have it too.
"""

import ctypes
from typing import Any

from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave


class _Prefixed:
    """Lets fmpy call the prefixed functions of a library by their plain names."""

    def __init__(self, library: ctypes.CDLL, prefix: str):
        self._library, self._prefix, self._handle = library, prefix, library._handle

    def __getattr__(self, name: str) -> Any:
        return getattr(self._library, self._prefix + name)


def _plain(library: ctypes.CDLL, identifier: str, version: int) -> Any:
    name = f"fmi{version}DoStep"
    prefix = f"{identifier}_"
    return _Prefixed(library, prefix) if not hasattr(library, name) and hasattr(library, prefix + name) else library


class FMU2Library(FMU2Slave):
    """The library of an FMU for FMI 2.0."""

    def _loadFunctions(self) -> None:
        self.dll = _plain(self.dll, self.modelIdentifier, 2)
        super()._loadFunctions()


class FMU3Library(FMU3Slave):
    """The library of an FMU for FMI 3.0."""

    def _loadFunctions(self) -> None:
        self.dll = _plain(self.dll, self.modelIdentifier, 3)
        super()._loadFunctions()
