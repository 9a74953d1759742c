"""The sensors on the bus: the machine, its log and the loop that runs them."""

from functools import partial
from itertools import chain
from typing import Any

from phototaxis.runtime.bus import Bus
from phototaxis.runtime.chunks import LogPublisher
from phototaxis.runtime.runner import Runner
from phototaxis.wire.messages import SensorsLog

from phototaxis_sensors.choice import SensorFactory, make_suite
from phototaxis_sensors.sensing import Sensing


def serve(bus: Bus, choice: SensorFactory) -> None:
    """Answer every state with its readings, from the models of `choice`, until a "stop" event."""
    log = LogPublisher(bus, "log/sensors", partial(chunk, bus.ident))
    Runner(bus, Sensing(partial(make_suite, choice)), log=log).run()


def chunk(writer: str, seq: int, head: tuple[Any, ...], columns: list[tuple[Any, ...]]) -> SensorsLog:
    """What `Sensing` records, as columns; the head of a chunk is the run and the names of the two models."""
    run, sonar_model, light_model = head
    ticks, sonars, lights = columns
    return SensorsLog(
        run=run,
        seq=seq,
        writer=writer,
        sonar_model=sonar_model,
        light_model=light_model,
        tick=list(ticks),
        sonar=list(chain.from_iterable(sonars)),
        light=list(chain.from_iterable(lights)),
    )
