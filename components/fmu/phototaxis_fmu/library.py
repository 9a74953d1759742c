"""fmpy's libraries of FMUs, which may have the prefix that the standard has for sources: MODEL_fmi3DoStep."""

import ctypes
from typing import Any

from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave


class _Prefixed:
    """A library whose functions are called by their plain names."""

    def __init__(self, library: ctypes.CDLL, prefix: str):
        self._library, self._prefix, self._handle = library, prefix, library._handle

    def __getattr__(self, name: str) -> Any:
        return getattr(self._library, self._prefix + name)


def _plain(library: ctypes.CDLL, identifier: str, version: int) -> Any:
    name = f"fmi{version}DoStep"
    prefix = f"{identifier}_"
    return _Prefixed(library, prefix) if not hasattr(library, name) and hasattr(library, prefix + name) else library


class FMU2Library(FMU2Slave):
    """An FMU of FMI 2.0."""

    def _loadFunctions(self) -> None:
        self.dll = _plain(self.dll, self.modelIdentifier, 2)
        super()._loadFunctions()


class FMU3Library(FMU3Slave):
    """An FMU of FMI 3.0."""

    def _loadFunctions(self) -> None:
        self.dll = _plain(self.dll, self.modelIdentifier, 3)
        super()._loadFunctions()
