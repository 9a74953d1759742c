"""A disk that may be full for a while."""

import errno
import os

from phototaxis.runtime.journal import Journal


class Disk(Journal):
    """A journal on a disk that refuses every entry while it is full.

    Attributes
    ----------
    full : whether the disk is.
    """

    full = False

    def begin(self, header: bytes) -> None:
        self._refuse_when_full()
        super().begin(header)

    def append(self, payload: bytes) -> None:
        self._refuse_when_full()
        super().append(payload)

    def _refuse_when_full(self) -> None:
        if self.full:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self.path))
