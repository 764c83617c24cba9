"""What a client connects to: a body of its own, or `humanclaw mcp` over HTTP or standard streams.

The environment and the arguments of the process say which.
"""

import os
import sys

TASK, MODEL, URL = os.environ["TASK"], os.environ["MODEL_URL"], os.environ.get("MCP_URL", "")
COMMAND, ARGS = (sys.argv[1], sys.argv[2:]) if sys.argv[1:] else ("", [])
"""Of the server over standard streams."""
SERVED = bool(URL or COMMAND)
"""Whether the body is behind a server; otherwise the client has it by `body.tools`."""
