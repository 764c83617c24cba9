"""The current view in a browser: a page on 127.0.0.1 that follows the body."""

from __future__ import annotations

import io
import json
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

_PAGE = """<!doctype html><html lang="en"><meta charset="utf-8"><title>HumanCLAW</title>
<style>body{margin:0;background:#16181c;color:#e8e6e1;font:16px/1.5 system-ui;display:grid;place-items:center;min-height:100vh}
figure{margin:1rem;width:min(92vw,80vh)}img{width:100%;border-radius:6px;display:block}figcaption{margin-top:.6rem}</style>
<figure><img id="view" alt="What the body sees"><figcaption id="words"></figcaption></figure>
<script>
let shown = -1;
async function follow() {
  try {
    const now = await (await fetch("state", {cache: "no-store"})).json();
    if (now.step !== shown) {
      shown = now.step;
      document.getElementById("view").src = "view.png?" + shown;
      document.getElementById("words").textContent = now.words;
    }
  } catch (error) { document.getElementById("words").textContent = "The run has ended."; }
  setTimeout(follow, 200);
}
follow();
</script></html>"""


class Window:
    """Serves one picture and a line of words until it is closed. Reachable from this machine only."""

    def __init__(self, port: int = 0) -> None:
        """port 0: any free one. Raises OSError if the port is taken."""
        self._picture, self._state = b"", {"step": -1, "words": ""}
        self._server = ThreadingHTTPServer(("127.0.0.1", port), self._handler())
        self._server.daemon_threads = True
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self._server.server_port}/"

    def show(self, rgb: NDArray[np.uint8], step: int, words: str) -> None:
        """Put a (H, W, 3) picture on the page."""
        buffer = io.BytesIO()
        Image.fromarray(rgb).save(buffer, "PNG")
        self._picture, self._state = buffer.getvalue(), {"step": step, "words": words}

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        window = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                content, kind = window._content(self.path.split("?")[0])
                self.send_response(200 if content else 404)
                self.send_header("Content-Type", kind)
                self.send_header("Content-Length", str(len(content)))
                self.end_headers()
                self.wfile.write(content)

            def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
                """The terminal belongs to the person."""

        return Handler

    def _content(self, path: str) -> tuple[bytes, str]:
        if path == "/":
            return _PAGE.encode(), "text/html; charset=utf-8"
        if path == "/state":
            return json.dumps(self._state).encode(), "application/json"
        return (self._picture, "image/png") if path == "/view.png" else (b"", "text/plain")
