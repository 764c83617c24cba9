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

_PAGE = """<!doctype html><html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>HumanCLAW</title><link rel="icon" href="data:,">
<style>
body{margin:0;padding:1.2rem;box-sizing:border-box;min-height:100vh;background:#16181c;color:#e8e6e1;
  font:16px/1.5 system-ui,sans-serif;display:flex;flex-wrap:wrap;gap:1.6rem;align-items:center;justify-content:center}
img{width:min(100%,100vh - 2.4rem);aspect-ratio:1;border-radius:6px;display:block}
figure{margin:0;flex:3 1 24rem;max-width:calc(100vh - 2.4rem)}
main{flex:1 1 15rem;max-width:26rem}
h1{font-size:1.5rem;line-height:1.25;margin:0 0 .8rem}
#step{color:#9aa3ad;margin:0;font-weight:600}
#feedback{margin:.3rem 0 1.4rem}
small{color:#9aa3ad}
</style></head><body>
<figure><img id="view" alt="What the body sees"></figure>
<main><h1 id="instruction"></h1><p id="step"></p><p id="feedback" aria-live="polite"></p>
<small id="hint">Type the next call in the terminal; help lists them.</small></main>
<script>
const put = (name, text) => { document.getElementById(name).textContent = text; };
let shown = "", count = 0;
async function follow() {
  try {
    const told = await (await fetch("state", {cache: "no-store"})).text();
    const now = JSON.parse(told);
    if (told !== shown && now.step >= 0) {
      shown = told;
      document.getElementById("view").src = "view.png?" + count++;
      put("instruction", now.instruction);
      put("step", "Step " + now.step);
      put("feedback", now.feedback);
    }
    setTimeout(follow, 200);
  } catch (error) { put("hint", "The run has ended."); }
}
follow();
</script></body></html>"""


class Window:
    """Serves one picture and a line of words until it is closed. Reachable from this machine only."""

    def __init__(self, port: int = 0) -> None:
        """port 0: any free one. Raises OSError if the port is taken."""
        self._picture = b""
        self._state: dict[str, Any] = {"step": -1, "instruction": "", "feedback": ""}
        self._server = ThreadingHTTPServer(("127.0.0.1", port), self._handler())
        self._server.daemon_threads = True
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self._server.server_port}/"

    def show(self, rgb: NDArray[np.uint8], step: int, instruction: str, feedback: str = "") -> None:
        """Put a (H, W, 3) picture on the page, what is to be done, and what became of the last call."""
        buffer = io.BytesIO()
        Image.fromarray(rgb).save(buffer, "PNG")
        self._picture = buffer.getvalue()
        self._state = {"step": step, "instruction": instruction, "feedback": feedback}

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
                """Log nothing: the terminal belongs to the person."""

        return Handler

    def _content(self, path: str) -> tuple[bytes, str]:
        if path == "/":
            return _PAGE.encode(), "text/html; charset=utf-8"
        if path == "/state":
            return json.dumps(self._state).encode(), "application/json"
        return (self._picture, "image/png") if path == "/view.png" else (b"", "text/plain")
