"""The current view in a browser: a page on 127.0.0.1 that follows the body, and whose keys move it."""

from __future__ import annotations

import hmac
import json
import secrets
import threading
from collections.abc import Callable, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.storage import jpeg

_LONGEST: Final = 4000
"""Bytes of a key's line and what is seen."""

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
table{border-spacing:0 .2rem;margin:0 0 1.2rem} th{text-align:left;padding-right:1rem;font-weight:600}
input{width:100%;box-sizing:border-box;font:inherit;padding:.4rem .6rem;margin:0 0 1.2rem;border-radius:6px;
  border:1px solid #4a515a;background:#22262c;color:inherit}
</style></head><body>
<figure><img id="view" alt="What the body sees"></figure>
<main><h1 id="instruction"></h1><p id="step"></p><p id="feedback" aria-live="polite"></p>
<input id="seen" aria-label="What you see" placeholder="What you see, told with the next call" maxlength="500">
<table id="keys" aria-label="Keys"></table>
<small id="hint">Press a key here, or type a call in the terminal; help lists them.</small></main>
<script>
const secret = "SECRET", signs = {ArrowUp: "\u2191", ArrowDown: "\u2193", ArrowLeft: "\u2190", ArrowRight: "\u2192"};
let keys = {};
const put = (name, text) => { document.getElementById(name).textContent = text; };
let shown = "", count = 0;
function legend(now) {
  keys = now;
  const table = document.getElementById("keys");
  table.replaceChildren(...Object.entries(keys).map(([key, line]) => {
    const row = table.insertRow();
    row.appendChild(document.createElement("th")).textContent = key.replace(/Arrow\\w+/, (name) => signs[name]);
    row.insertCell().textContent = line;
    return row;
  }));
}
document.addEventListener("keydown", (event) => {
  const line = keys[(event.shiftKey ? "Shift+" : "") + event.key], seen = document.getElementById("seen");
  if (!line || event.target === seen || event.repeat || event.ctrlKey || event.metaKey || event.altKey) return;
  event.preventDefault();
  const body = seen.value.trim() ? `${line} # ${seen.value.trim()}` : line;
  fetch("call", {method: "POST", headers: {"X-HumanCLAW": secret}, body}).then((answer) => {
    if (answer.ok) seen.value = "";
  });
});
async function follow() {
  try {
    const told = await (await fetch("state", {cache: "no-store"})).text();
    const now = JSON.parse(told);
    if (told !== shown && now.step >= 0) {
      shown = told;
      document.getElementById("view").src = "view.jpg?" + count++;
      put("instruction", now.instruction);
      put("step", "Step " + now.step);
      put("feedback", now.feedback);
      legend(now.keys);
    }
    setTimeout(follow, 200);
  } catch (error) { put("hint", "The run has ended."); }
}
follow();
</script></body></html>"""


class Window:
    """Serves one picture and a line of words until it is closed, to pages of this machine alone."""

    def __init__(self, port: int = 0, submit: Callable[[str], None] = lambda line: None) -> None:
        """port 0: any free one. submit: gets the line of a key that was pressed. Raises OSError if the port is
        taken."""
        self._picture = b""
        self._state: dict[str, Any] = {"step": -1, "instruction": "", "feedback": "", "keys": {}}
        self._submit = submit
        self._asking = threading.Lock()
        """Free while a call is waited for: a key that is pressed while the body moves moves nothing."""
        self._asking.acquire()
        self._secret = secrets.token_urlsafe(16)
        """Known to the page alone: no other page of the browser can press a key."""
        self._server = ThreadingHTTPServer(("127.0.0.1", port), self._handler())
        self._server.daemon_threads = True
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self._server.server_port}/"

    def show(
        self,
        rgb: NDArray[np.uint8],
        step: int,
        instruction: str,
        feedback: str = "",
        keys: Mapping[str, str] | None = None,
    ) -> None:
        """Put a (H, W, 3) picture on the page, what is to be done, what became of the last call and what keys do.

        The picture is the JPEG that a model is shown. From now on one key is taken.
        """
        self._picture = jpeg(rgb)
        self._state = {"step": step, "instruction": instruction, "feedback": feedback, "keys": dict(keys or {})}
        self.settle()
        self._asking.release()

    def settle(self) -> None:
        """Take no key until the next picture: a call has come from elsewhere."""
        self._asking.acquire(blocking=False)

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        window = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                if self._is_ours():
                    content, kind = window._content(self.path.split("?")[0])
                    self._answer(200 if content else 404, content, kind)

            def do_POST(self) -> None:
                if self._is_ours():
                    told = self.headers.get("Content-Length", "")
                    length = int(told) if told.isdecimal() else 0
                    known = hmac.compare_digest(self.headers.get("X-HumanCLAW", "").encode(), window._secret.encode())
                    line = self.rfile.read(length).decode("utf-8", "replace") if known and 0 < length < _LONGEST else ""
                    self._answer(window._press(line) if known and self.path == "/call" else 403)

            def _is_ours(self) -> bool:
                """Only names of this machine are answered: a page elsewhere whose name was rebound to it has
                another."""
                port = window._server.server_port
                if self.headers.get("Host") in (f"127.0.0.1:{port}", f"localhost:{port}"):
                    return True
                self._answer(421)
                return False

            def _answer(self, code: int, content: bytes = b"", kind: str = "text/plain") -> None:
                self.send_response(code)
                self.send_header("Content-Type", kind)
                self.send_header("Content-Length", str(len(content)))
                self.end_headers()
                self.wfile.write(content)

            def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
                """Log nothing: the terminal belongs to the person."""

        return Handler

    def _press(self, line: str) -> int:
        """Return the status to answer with: whether this line was waited for, and is one of a key."""
        if line.partition("#")[0].strip() not in self._state["keys"].values():
            return 400
        if not self._asking.acquire(blocking=False):
            return 409
        self._submit(" ".join(line.split()))
        return 204

    def _content(self, path: str) -> tuple[bytes, str]:
        if path == "/":
            return _PAGE.replace("SECRET", self._secret).encode(), "text/html; charset=utf-8"
        if path == "/state":
            return json.dumps(self._state).encode(), "application/json"
        return (self._picture, "image/jpeg") if path == "/view.jpg" else (b"", "text/plain")
