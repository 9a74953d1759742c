"""`phototaxis recorder`: runs the recorder as a process."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from msgspec import Meta
from phototaxis.guard import exposure
from phototaxis.runtime.component import ComponentOptions, entry, run
from phototaxis.runtime.disk import check_folder_writable, check_writable
from phototaxis.runtime.errors import UserError
from phototaxis.runtime.options import parse
from phototaxis.runtime.ports import find_ports, viewer_url
from phototaxis.wire.messages import World

from phototaxis_recorder.page import ViewerPage
from phototaxis_recorder.viewer import silence_rerun


class Options(ComponentOptions, kw_only=True):
    """Options of the recorder."""

    output: str = "recording.rrd"
    """file to record into, or a folder for RUN.rrd; if the file exists, the new one gets a number"""
    bind: str = "127.0.0.1"
    """address that the viewer's ports listen on; an address that other machines reach needs --insecure"""
    grpc_port: Annotated[int, Meta(ge=0, le=65535)] = 9876
    """port of the live Rerun server; 0: any free one"""
    web_port: Annotated[int, Meta(ge=-1, le=65535)] = 9090
    """port of the web viewer's page; 0: any free one; -1: none"""
    memory: Annotated[str, Meta(pattern=r"^[0-9]+(MB|GB|MiB|GiB)$", description="a size in MB, GB, MiB or GiB")] = (
        "256MiB"
    )
    """memory in which the live server keeps data for viewers that connect late, such as 256MiB"""


def main(argv: Sequence[str] | None = None) -> None:
    options = parse(Options, argv, "phototaxis recorder", "Record the run on the bus, live and on disk.")
    if not options.insecure and not exposure.is_loopback(options.bind):
        raise UserError(
            f"--bind {options.bind}: others could watch, since nothing guards the viewer; use 127.0.0.1 or --insecure"
        )
    silence_rerun()
    os.environ.setdefault("RUST_LOG", "warn,re_log_encoding::rrd::file_sink=error")  # it warns that footers are missing
    from phototaxis_recorder.server import serve
    from phototaxis_recorder.sinks import RecordingSinks

    output = Path(options.output)
    if output.is_dir():
        check_folder_writable(output, "--output")
    else:
        check_writable(output, "--output")
    wanted = {"--grpc-port": options.grpc_port, "--web-port": options.web_port}
    grpc_port, web_port = find_ports(options.bind, wanted)

    def start(world: World) -> RecordingSinks:
        file = output / f"{world.run}.rrd" if output.is_dir() else output
        print(f"recorder: records the run {world.run} into {file}", file=sys.stderr, flush=True)
        return RecordingSinks(world, file, options.bind, grpc_port, options.memory)

    page = ViewerPage(options.bind, web_port, grpc_port) if web_port >= 0 else None
    if page is not None:
        print(f"recorder: watch at {viewer_url(web_port, grpc_port)}", file=sys.stderr, flush=True)

    try:
        run("recorder", options, lambda bus: serve(bus, start))
    finally:
        if page is not None:
            page.close()


if __name__ == "__main__":
    entry(main)
