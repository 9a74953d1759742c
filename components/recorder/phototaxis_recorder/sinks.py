"""The two sinks of a recording: a file and the live gRPC server."""

import os
import shutil
import subprocess
from pathlib import Path

import rerun as rr
from phototaxis.runtime.disk import write_failure
from phototaxis.runtime.errors import Unavailable, warn
from phototaxis.wire.messages import World

from phototaxis_recorder.file import RecordingFile
from phototaxis_recorder.layout import blueprint
from phototaxis_recorder.summary import write_summary
from phototaxis_recorder.translate import Translator
from phototaxis_recorder.viewer import rerun_program

MAX_REWRITTEN_BYTES = 250_000_000
"""A larger recording is not rewritten at its end, because that takes more than twice its size in memory."""
MIN_FREE_BYTES = 200_000_000
"""The recorder warns when the disk has less free space."""


class RecordingSinks:
    """The recording of one run: a live server, and a file with a summary that says up to which tick it goes.

    When writing fails, the file is cut back to the tick of its last summary and writing stops; the live view goes on.
    The file has no footer while it grows, because Rerun would keep the footer's entries in memory, some 20 MB a
    minute at full speed.

    Attributes
    ----------
    translator : converts log chunks, and writes them to both sinks.
    file : path of the file, also when it could not be made.
    fault : a line that says why writing has stopped or the summary is missing; "" while all is well.
    low : a line that says that the disk is nearly full; "" while it is not.
    kept : the newest tick in the file; −1 for none.
    """

    def __init__(self, world: World, wanted: Path, host: str, grpc_port: int, memory: str):
        self.file, self.fault, self.low, self.kept = wanted, "", "", -1
        self._size, self._stopped, self._out = 0, False, self._open()
        sinks: list[rr.GrpcServerSink | rr.FileSink] = [rr.GrpcServerSink(host, grpc_port, server_memory_limit=memory)]
        if self._out is not None:
            self.file = self._out.path
            sinks.append(rr.FileSink(self._out.sink, write_footer=False))
        self._stream = rr.RecordingStream("phototaxis", recording_id=f"{world.run}-{self.file.stem}")
        rr.set_log_time_enabled(False, recording=self._stream)
        self._stream.set_sinks(*sinks, default_blueprint=blueprint(world.arena, world.epochs))
        self._stream.send_recording_name(f"{world.arena.name}, {world.run}")
        self.translator = Translator(self._stream, world)
        if self.fault:
            self._tell(self.fault)

    def keep(self) -> None:
        """Write everything logged so far to disk, then its summary."""
        if self._out is None or self._stopped:
            return
        summary = self.translator.summary
        try:
            self._stream.flush()
            size = self._out.settle()
            if size == self._size:
                return
            write_summary(self.file, summary)
        except (RuntimeError, OSError) as error:
            self._stopped = True
            self._out.cut(self._size)
            told = f"recorded up to tick {self.kept}" if self.kept >= 0 else "nothing is recorded"
            self._fail(f"{write_failure(self.file, error) if isinstance(error, OSError) else error}; {told}")
        except Unavailable as error:  # only the summary could not be written
            self._fail(str(error))
        else:
            self.fault, self._size, self.kept = "", size, summary.tick
            self._mind_the_space()

    def close(self) -> None:
        """Close the file, and add its footer if there is room on the disk."""
        self._stream.disconnect()
        if self._out is not None:
            self._out.close()
            if not self._stopped:
                complete(self.file)

    def _open(self) -> RecordingFile | None:
        try:
            return RecordingFile(self.file)
        except OSError as error:
            self.fault = f"{write_failure(self.file, error)}; nothing is recorded"
            return None

    def _mind_the_space(self) -> None:
        free = shutil.disk_usage(self.file.parent).free
        if free < MIN_FREE_BYTES and not self.low:
            self.low = f"{self.file}: less than {MIN_FREE_BYTES / 1e6:.0f} MB are left on its disk"
            self._tell(self.low)

    def _fail(self, fault: str) -> None:
        if self.fault != fault:
            self.fault = fault
            self._tell(fault)

    def _tell(self, text: str) -> None:
        warn(text)
        self.translator.event(text)


def complete(file: Path) -> None:
    """Rewrite a closed recording with a footer and larger chunks, so that it opens fast.

    A large recording stays as it is, and so does one of which a copy does not fit on the disk.
    """
    try:
        size, free = file.stat().st_size, shutil.disk_usage(file.parent).free
    except FileNotFoundError:
        return
    if size > min(MAX_REWRITTEN_BYTES, free):
        return
    part = file.with_suffix(".part")
    command = [rerun_program(), "rrd", "optimize", file, "-o", part]
    if subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False).returncode == 0:
        os.replace(part, file)
    else:
        part.unlink(missing_ok=True)
