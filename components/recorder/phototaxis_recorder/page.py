"""Serves Rerun's web viewer, and keeps the browser from contacting other servers."""

import re
import socketserver
import subprocess
import time
from http.client import HTTPConnection
from http.server import BaseHTTPRequestHandler
from threading import Lock, Thread
from typing import cast

from phototaxis.runtime.errors import ComponentFailed
from phototaxis.runtime.ports import free_ports

from phototaxis_recorder.viewer import STARTS_WITHIN_S, rerun_program

VIEWER_PATHS = ("/", "/re_viewer.js", "/re_viewer_bg.wasm", "/favicon.ico", "/apple-touch-icon.png")
"""All files of the web viewer."""
EXTERNAL_LINK = re.compile(rb"""<link[^>]*href="https://[^>]*>""")
"""Hints in the page that make a browser connect to other servers; a content security policy does not cover them."""


class ViewerPage(socketserver.ThreadingTCPServer):
    """Serves Rerun's web viewer on one address, from threads of this process.

    By default the viewer fetches fonts, reports its use and looks for updates. A content security policy makes the
    browser connect only to this page and to recordings on `grpc_port`. The files come from Rerun's own program when
    the first browser asks for them.
    """

    allow_reuse_address = daemon_threads = True

    def __init__(self, host: str, port: int, grpc_port: int):
        super().__init__((host, port), _Handler)
        self.policy = (
            "default-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob:; "
            f"connect-src 'self' data: blob: http://localhost:{grpc_port} http://*:{grpc_port}"
        )
        self._lock = Lock()
        self._files: dict[str, tuple[str, bytes]] = {}
        Thread(target=self.serve_forever, daemon=True).start()

    def file(self, path: str) -> tuple[str, bytes] | None:
        """Return type and content of one of the viewer's files, or None if it has no such file."""
        with self._lock:
            self._files = self._files or _viewer_files()
        return self._files.get(path)

    def close(self) -> None:
        """Stop serving, and free the port."""
        self.shutdown()
        self.server_close()


class _Handler(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        page = cast(ViewerPage, self.server)
        try:
            found = page.file(self.path.partition("?")[0])
        except ComponentFailed as error:
            self.send_error(502, str(error))
            return
        if found is None:
            self.send_error(404)
            return
        kind, content = found
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Content-Security-Policy", page.policy)
        self.end_headers()
        try:
            self.wfile.write(content)
        except ConnectionError:
            self.close_connection = True  # the browser has closed the page

    def log_message(self, format: str, *args: object) -> None:
        """Print nothing for a request; the base class would print a line."""


def _viewer_files() -> dict[str, tuple[str, bytes]]:
    """Fetch the web viewer's files from Rerun's own program.

    A shell runs the program until its standard input closes, so that the program ends even when this process is
    killed. A session of their own keeps Ctrl-C from reaching either.
    """
    page, grpc = free_ports(2)
    program = [
        rerun_program(),
        "--serve-web",
        "--bind",
        "127.0.0.1",
        "--web-viewer-port",
        str(page),
        "--port",
        str(grpc),
    ]
    process = subprocess.Popen(
        ["/bin/sh", "-c", '"$@" & cat >/dev/null; kill $!; wait', "page", *program],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        files = {path: _fetch(page, path) for path in VIEWER_PATHS}
        kind, html = files["/"]
        files["/"] = kind, EXTERNAL_LINK.sub(b"", html)
        return files
    finally:
        process.communicate()


def _fetch(port: int, path: str) -> tuple[str, bytes]:
    """Return type and content of a file; the program that serves it may still be starting."""
    deadline = time.monotonic() + STARTS_WITHIN_S
    while True:
        connection = HTTPConnection("127.0.0.1", port, timeout=STARTS_WITHIN_S)
        try:
            connection.request("GET", path)
            answer = connection.getresponse()
            return answer.headers["Content-Type"], answer.read()
        except OSError as error:
            if time.monotonic() > deadline:
                raise ComponentFailed(f"Rerun's program does not serve its web viewer: {error}") from None
            time.sleep(0.05)
        finally:
            connection.close()
