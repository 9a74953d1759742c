"""The phases of the simulation, and the table of transitions between them."""

from enum import StrEnum


class Phase(StrEnum):
    """What the simulation is doing."""

    WAITING = "waiting"
    """Nobody drives."""
    ASKING = "asking"
    """The driver is asked for the present tick's command."""
    PAUSED = "paused"
    """The present tick is still answered, and no command is applied but in single steps."""
    FINISHED = "finished"
    """The last tick of the run has its answer."""
    ENDING = "ending"
    """The simulation is asked to stop, and waits for the answer to the present tick."""
    ENDED = "ended"


class Given(StrEnum):
    """What moves the simulation from phase to phase."""

    SEATED = "somebody drives"
    VACATED = "nobody drives"
    PAUSE = "pause"
    RESUME = "resume"
    LAST = "the last answer"
    BEGIN = "begin"
    STOP = "stop"
    END = "answered, or too late"


_RUNNING = (Phase.WAITING, Phase.ASKING)
_GOING = (*_RUNNING, Phase.PAUSED)
_STANDING = (Phase.PAUSED, Phase.FINISHED, Phase.ENDING)

TABLE = {
    (Phase.WAITING, Given.SEATED): Phase.ASKING,
    (Phase.WAITING, Given.VACATED): Phase.WAITING,
    (Phase.ASKING, Given.SEATED): Phase.ASKING,
    (Phase.ASKING, Given.VACATED): Phase.WAITING,
    **{(phase, given): phase for phase in _STANDING for given in (Given.SEATED, Given.VACATED)},
    **{(phase, Given.PAUSE): Phase.PAUSED for phase in _GOING},
    **{(phase, Given.RESUME): phase for phase in (*_RUNNING, Phase.FINISHED)},
    (Phase.ENDING, Given.PAUSE): Phase.ENDING,
    (Phase.PAUSED, Given.RESUME): Phase.WAITING,
    **{(phase, Given.LAST): Phase.FINISHED for phase in (Phase.ASKING, Phase.PAUSED, Phase.ENDING)},
    **{(phase, Given.BEGIN): phase for phase in _GOING},
    (Phase.FINISHED, Given.BEGIN): Phase.WAITING,
    **{(phase, Given.STOP): Phase.ENDING for phase in (*_GOING, Phase.ENDING)},
    **{(phase, Given.END): Phase.ENDED for phase in (*_GOING, Phase.FINISHED, Phase.ENDING)},
}
"""For each phase and what is given in it, the next phase."""
