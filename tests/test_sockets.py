"""Nothing listens and nothing calls out but what the user named: all other sockets are refused, and runs go well."""

import subprocess
import sys

import pytest
from model_servers import OpenAIServer, call

GUARD = """
import os, sys
allowed = set(filter(None, sys.argv.pop(1).split(",")))
def guard(event, arguments):
    if event in ("socket.connect", "socket.bind", "socket.sendto"):
        address = arguments[1]
    elif event in ("socket.getaddrinfo", "socket.gethostbyname"):
        address = arguments[:2]
    else:
        return
    if not isinstance(address, tuple):
        return  # A socket of the file system.
    where = f"{address[0]}:{address[1]}" if len(address) > 1 else str(address[0])
    if where not in allowed:
        print("SOCKET", event, where, file=sys.stderr, flush=True)
        raise PermissionError(f"{event} {where}")
sys.addaudithook(guard)
from humanclaw.cli import main
main(sys.argv[1:])
"""


def guarded(folder, allowed, *arguments):
    """A command in a process where any other socket fails."""
    command = [sys.executable, "-c", GUARD, ",".join(allowed), *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, check=False)
    assert "SOCKET" not in done.stderr
    return done


@pytest.mark.integration
def test_the_guard_would_see_a_socket(tmp_path):
    address = "import socket; socket.create_server(('127.0.0.1', 0))"
    code = GUARD.replace("from humanclaw.cli import main\nmain(sys.argv[1:])", address)
    done = subprocess.run([sys.executable, "-c", code, ""], capture_output=True, text=True, check=False)
    assert "SOCKET socket.bind 127.0.0.1:0" in done.stderr


@pytest.mark.integration
def test_an_episode_of_a_script_opens_no_socket(tmp_path):
    done = guarded(tmp_path, (), "run", "--agent", "still", "--max-steps", "1", "--out", "r")
    assert done.returncode == 0, done.stderr


@pytest.mark.integration
def test_an_episode_of_a_model_speaks_to_its_server_alone(tmp_path):
    with OpenAIServer(lambda request: call("stop") if "walk" in request.tool_names else call("verdict")) as server:
        # urllib3, which some versions of litellm import, asks in this way whether the machine has IPv6.
        named = [server.origin.removeprefix("http://"), "::1:0"]
        model = ["--model", "openai/x", "--option", f"api_base={server.url}"]
        done = guarded(tmp_path, named, "run", *model, "--max-steps", "2", "--out", "r")
    assert done.returncode == 0, done.stderr
    assert server.requests
