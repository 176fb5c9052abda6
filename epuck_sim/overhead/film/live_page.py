"""Shows a film in a browser while it grows: a page on this machine with the newest picture."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from html import escape
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import cv2

from epuck_sim.overhead.film.frame import Picture
from epuck_sim.util.ports import HOST, check_port

BOUNDARY = "picture"
PAGE = """<!doctype html><html lang="en"><meta charset="utf-8"><title>{title}</title>
<body style="margin:0;background:#111;display:grid;place-items:center;min-height:100vh">
<img src="/film" alt="{title}: rings found, and the histogram" style="max-width:100vw;max-height:100vh">
</body></html>"""


class LivePage:
    """The newest picture of a film, for browsers that wait for it; `live_page` makes one."""

    address: str
    """Where browsers find it."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._jpeg = b""
        self._number = 0

    def show(self, picture: Picture) -> None:
        """Show a picture, (height_px, width_px, 3) levels, in all browsers."""
        coded = cv2.imencode(".jpg", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))[1].tobytes()
        with self._changed:
            self._jpeg, self._number = coded, self._number + 1
            self._changed.notify_all()

    def pictures(self) -> Iterator[bytes]:
        """Yield the newest picture, as JPEG, whenever there is a newer one; a slow reader misses some."""
        seen = 0
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._number > seen)  # noqa: B023 - called before the next turn
                seen, jpeg = self._number, self._jpeg
            yield jpeg


@contextmanager
def live_page(title: str, port: int) -> Iterator[LivePage]:
    """Serve a page to browsers on this machine for as long as the block lasts.

    Args:
        title: Title of the page.
        port: Where browsers find it; 0 for any that is free.

    Raises:
        PortError: The port cannot be used.
    """
    page = LivePage()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            if self.path == "/film":
                self._send_film()
            elif self.path == "/":
                self._begin("text/html; charset=utf-8")
                self.wfile.write(PAGE.format(title=escape(title)).encode())
            else:
                self.send_error(404)

        def _begin(self, kind: str) -> None:
            self.send_response(200)
            self.send_header("Content-Type", kind)
            self.send_header("Cache-Control", "no-store")
            self.end_headers()

        def _send_film(self) -> None:
            self._begin(f"multipart/x-mixed-replace; boundary={BOUNDARY}")
            try:
                for jpeg in page.pictures():
                    head = f"--{BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n\r\n"
                    self.wfile.write(head.encode() + jpeg + b"\r\n")
            except OSError:
                pass  # the browser has left

        def log_message(self, *_: object) -> None:
            """Keep the terminal for what is told of the film."""

    check_port(port)
    server = ThreadingHTTPServer((HOST, port), Handler)
    page.address = f"http://{HOST}:{server.server_address[1]}/"
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield page
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
