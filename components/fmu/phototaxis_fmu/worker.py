"""The process that runs an FMU's code: it loads one FMU and steps its instances for its parent.

Requests come on standard input, and answers go to the original standard output; what the FMU prints and logs goes to
standard error. The first request is an `InstanceSetup` in JSON, after its length. Each later request is a head (`HEAD`:
what to do, number of periods) and the inputs of all instances as doubles. An answer is a head (`DONE` and 0) and the
outputs, or a head (`FAILED` and the length of a text) and the text. A head with `REPLACED` and its text may precede it.
"""

import fcntl
import os
import struct
import sys
from contextlib import suppress

import msgspec

from phototaxis_fmu.instance import Instance, InstanceSetup, Voice, explain

HEAD = struct.Struct("<qq")
LENGTH = struct.Struct("<q")
BEGIN, STEP = 1, 2
MIN_PIPE_NUMBER = 200
"""Lowest file descriptor of our pipes: some FMUs close low ones, which they take for their own."""
DONE, FAILED, REPLACED = 0, 1, 2


class Worker:
    """Holds all instances, and the buffers that they share."""

    def __init__(self, setup: InstanceSetup, voice: Voice):
        size_in, size_out = (8 * sum(end.values for end in ends) for ends in (setup.inputs, setup.outputs))
        self.inputs = bytearray(HEAD.size + size_in * setup.instances)
        self.outputs = bytearray(HEAD.size + size_out * setup.instances)
        self._voice = voice
        self.instances = [
            Instance(
                setup, number, (self.inputs, HEAD.size + number * size_in),
                (self.outputs, HEAD.size + number * size_out), voice,
            )
            for number in range(setup.instances)
        ]  # fmt: skip

    def answer(self) -> str:
        """Do what the head of the inputs says; return why instances were replaced, or "" if none was."""
        order, count = HEAD.unpack_from(self.inputs)
        self._voice.forget()
        replaced = ""
        for one in self.instances:
            if order == BEGIN:
                replaced = one.begin() or replaced
            else:
                one.step(count)
        return replaced


def read(source: int, into: memoryview) -> bool:
    """Fill a buffer from a file descriptor; return False at the end of the stream."""
    while into:
        got = os.readv(source, [into])
        if not got:
            return False
        into = into[got:]
    return True


def serve(source: int, answers: int) -> None:
    """Load the FMU, then answer requests until the parent closes the stream."""
    length = bytearray(LENGTH.size)
    if not read(source, memoryview(length)):
        return
    text = bytearray(LENGTH.unpack(length)[0])
    read(source, memoryview(text))
    setup = msgspec.json.decode(text, type=InstanceSetup)
    voice = Voice(setup.least)
    try:
        worker = Worker(setup, voice)
        os.write(answers, HEAD.pack(DONE, 0))
        while read(source, memoryview(worker.inputs)):
            if replaced := worker.answer():
                _say(answers, REPLACED, replaced)
            os.write(answers, worker.outputs)
        for one in worker.instances:
            one.end()
    except Exception as error:  # any error: the parent reports it
        with suppress(BrokenPipeError):
            _say(answers, FAILED, explain(error, voice))


def _say(answers: int, kind: int, words: str) -> None:
    text = words.encode(errors="replace")
    os.write(answers, HEAD.pack(kind, len(text)) + text)


def main() -> None:
    source, answers = (fcntl.fcntl(pipe, fcntl.F_DUPFD_CLOEXEC, MIN_PIPE_NUMBER) for pipe in (0, 1))
    os.dup2(2, 1)  # so that the parent does not take what the FMU prints for an answer
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    serve(source, answers)
    sys.stdout.flush()


if __name__ == "__main__":
    main()
