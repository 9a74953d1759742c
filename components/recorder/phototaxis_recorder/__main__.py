"""`phototaxis recorder`: the recorder as a process."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from msgspec import Meta
from phototaxis.bus import Bus
from phototaxis.component import ComponentOptions, entry, run
from phototaxis.errors import UserError
from phototaxis.messages import World
from phototaxis.options import parse
from phototaxis.page import ViewerPage
from phototaxis.ports import find_ports
from phototaxis.recordings import write_summary
from phototaxis.viewer import silence_rerun, viewer_url


class Options(ComponentOptions, kw_only=True):
    """Options of the recorder."""

    output: str = "recording.rrd"
    """file to record into, or a folder for RUN.rrd; where it stands already, the new one gets a number"""
    bind: str = "127.0.0.1"
    """address that the viewer's ports listen on"""
    grpc_port: Annotated[int, Meta(ge=0, le=65535)] = 9876
    """port of the live Rerun server; 0: any free one"""
    web_port: Annotated[int, Meta(ge=-1, le=65535)] = 9090
    """port of the web viewer's page; 0: any free one; -1: none"""
    memory: Annotated[str, Meta(pattern=r"^[0-9]+(MB|GB|MiB|GiB)$")] = "256MiB"
    """memory for viewers that come late, such as 256MiB"""


def main(argv: Sequence[str] | None = None) -> None:
    options = parse(Options, argv, "phototaxis recorder", "Record the run on the bus, live and on disk.")
    silence_rerun()
    import rerun as rr

    from phototaxis_recorder.server import Server
    from phototaxis_recorder.sinks import complete, fresh_file, open_recording
    from phototaxis_recorder.translate import Translator

    output = Path(options.output)
    if not output.parent.is_dir():
        raise UserError(f"--output {output}: there is no folder {output.parent}")
    wanted = {"--grpc-port": options.grpc_port, "--web-port": options.web_port}
    grpc_port, web_port = find_ports(options.bind, wanted)
    recording: list[rr.RecordingStream] = []
    file = output

    def start(world: World) -> Translator:
        nonlocal file
        file = fresh_file(output / f"{world.run}.rrd" if output.is_dir() else output)
        recording.append(open_recording(world, file, options.bind, grpc_port, options.memory))
        return Translator(recording[0], world)

    def finish() -> None:
        while recording:
            recording.pop().disconnect()
            complete(file)

    page = ViewerPage(options.bind, web_port, grpc_port) if web_port >= 0 else None
    if page is not None:
        print(f"recorder: watch at {viewer_url(web_port, grpc_port)}", file=sys.stderr, flush=True)

    def serve(bus: Bus) -> None:
        Server(bus, start, finish, lambda summary: write_summary(file, summary)).serve()

    try:
        run("recorder", options, serve)
    finally:
        finish()
        if page is not None:
            page.close()


if __name__ == "__main__":
    entry(main)
