"""Runs the recorder on the bus: `Gathering` decides, `Desk` writes the recordings."""

from collections.abc import Callable

from phototaxis.runtime.bus import Bus
from phototaxis.runtime.errors import Unavailable
from phototaxis.runtime.machine import Own
from phototaxis.runtime.runner import Runner
from phototaxis.wire.messages import RecordingProgress, World

from phototaxis_recorder.gathering import Close, Gathering, Keep, Note, Open, Report
from phototaxis_recorder.reader import Write
from phototaxis_recorder.sinks import RecordingSinks


def serve(bus: Bus, start: Callable[[World], RecordingSinks]) -> None:
    """Record the runs on the bus until a "stop" event; then gather the chunks that are still missing, and end.

    Parameters
    ----------
    start : begins the recording of a world's run.

    Raises
    ------
    Unavailable
        when a recording could not be written completely.
    """
    desk = Desk(bus, start)
    try:
        Runner(bus, Gathering(), own=desk.carry).run()
    finally:
        desk.close()
    if desk.faults:
        raise Unavailable(desk.faults[0])


class Desk:
    """Carries out the effects of `Gathering`; between `Open` and `Close` there is a recording.

    Attributes
    ----------
    faults : for each closed recording that is not complete, a line that says why.
    """

    def __init__(self, bus: Bus, start: Callable[[World], RecordingSinks]):
        self._bus, self._start = bus, start
        self._run = ""
        self._recording: RecordingSinks | None = None
        self.faults: list[str] = []

    def carry(self, effect: Own) -> None:
        """Carry out one effect."""
        if isinstance(effect, Open):
            self._run, self._recording = effect.world.run, self._start(effect.world)
        elif isinstance(effect, Close):
            self.close()
        elif self._recording is not None:
            self._add(self._recording, effect)

    def _add(self, recording: RecordingSinks, effect: Own) -> None:
        match effect:
            case Write():
                recording.translator.add(effect.chunk)
            case Note():
                recording.translator.event(effect.text)
            case Keep():
                recording.translator.flush()
                recording.keep()
            case Report():
                self._bus.put(
                    "recording",
                    RecordingProgress(run=self._run, tick=recording.kept, warning=recording.fault or recording.low),
                )

    def close(self) -> None:
        """Write the chunks that wait, and close the recording, if there is one."""
        recording, self._recording = self._recording, None
        if recording is None:
            return
        recording.translator.flush(last=True)
        recording.keep()
        recording.close()
        if recording.fault:
            self.faults.append(recording.fault)
