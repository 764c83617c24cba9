# /// script
# dependencies = []
# ways = ["HTTP", "stdio"]
# npm = ["node@22", "@modelcontextprotocol/inspector@2.12.0"]
# ///
"""The MCP Inspector's command line. It has no agent: each command opens a session and sends one request."""

import json
import subprocess
import sys

from connection import ARGS, COMMAND, URL

NPX = ["npx", "--yes", "-p", "node@22", "-p", "@modelcontextprotocol/inspector@2.12.0", "mcp-inspector", "--cli"]


def ask(method, *options):
    where = [URL, "--transport", "http"] if URL else [COMMAND, *ARGS]
    command = [*NPX, *where, "--method", method, *options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=180, check=False)
    if done.returncode:
        sys.exit(f"{method}: {done.stderr or done.stdout}")
    return json.loads(done.stdout)


print(sorted(tool["name"] for tool in ask("tools/list")["tools"]))
for name, arguments in (("walk", ["z_cm=40"]), ("turn_in_place", ["yaw_deg=30"]), ("stop", [])):
    given = [part for argument in arguments for part in ("--tool-arg", argument)]
    result = ask("tools/call", "--tool-name", name, *given)
    assert [part["type"] for part in result["content"]] == ["text", "image"], result
    print(result["content"][0]["text"], f"{len(result['content'][1]['data'])} letters of picture")
print(ask("resources/read", "--uri", "humanclaw://body/state")["contents"][0]["mimeType"])
print(ask("prompts/get", "--prompt-name", "task")["messages"][0]["content"]["text"][:60])
