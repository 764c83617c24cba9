"""OpenEnv's own client plays training tasks over HTTP and WebSocket; TRL's trainer finds its tools."""

import socket
import threading
import time

import pytest

pytest.importorskip("openenv", reason="OpenEnv is not installed: pip install humanclaw-openenv")

import requests
import uvicorn
from openenv import GenericEnvClient
from openenv.core.env_server.mcp_types import CallToolAction
from openenv.core.mcp_client import MCPToolClient
from websockets.exceptions import ConnectionClosed

from humanclaw import Gym, Plugins
from humanclaw_openenv.server import app

STOP = {"type": "call_tool", "tool_name": "stop", "arguments": {"thoughts": "visible_state: A wall."}}


@pytest.fixture(scope="module")
def address():
    plugins = Plugins.discover()
    made = app(lambda: Gym("approach", options={"houses": 1}, plugins=plugins), sessions=3)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        server = uvicorn.Server(uvicorn.Config(made, log_level="warning"))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [taken]}, daemon=True)
        thread.start()
        while not server.started:
            time.sleep(0.05)
        yield f"http://127.0.0.1:{taken.getsockname()[1]}"
        server.should_exit = True
        thread.join(10)


def test_over_http_a_client_reads_schema_tools_and_a_first_view(address):
    assert requests.get(f"{address}/health").json()["status"] == "healthy"
    assert "tool_name" in requests.get(f"{address}/schema").json()["action"]["properties"]
    listed = requests.post(f"{address}/step", json={"action": {"type": "list_tools"}}).json()["observation"]["tools"]
    assert {"walk", "stop"} <= {tool["name"] for tool in listed}
    seen = requests.post(f"{address}/reset", json={"seed": 3}).json()["observation"]
    assert "Calling stop ends the episode" in seen["system"]
    assert seen["result"][-1]["image_url"]["url"].startswith("data:image/jpeg;base64,")


def test_over_websocket_an_episode_has_reward_done_and_state(address):
    with GenericEnvClient(base_url=address).sync() as env:
        begun = env.reset(seed=0)
        walk = {
            "type": "call_tool",
            "tool_name": "walk",
            "arguments": {"thoughts": "", "z_cm": 60, "x_cm": 0, "yaw_deg": 0},
        }
        walked = env.step(walk)
        assert not begun.done
        assert walked.reward == pytest.approx(0.3 * walked.observation["rewards"]["progress"])
        assert 0.1 < walked.observation["rewards"]["progress"] < 1.0
        assert "Executed walk" in walked.observation["result"][0]["text"]
        stopped = env.step(STOP)
        assert (stopped.done, stopped.observation["solved"]) == (True, False)
        state = env.state()
        assert (state["step_count"], state["episode_id"]) == (2, "approach-0")


def test_the_same_seed_begins_the_same_episode_in_every_session(address):
    views = []
    for seed in (1, 1, 2):
        with GenericEnvClient(base_url=address).sync() as env:
            views.append(env.reset(seed=seed).observation["result"][-1])
    assert views[0] == views[1]
    assert views[0] != views[2]


def test_sessions_run_side_by_side_and_one_too_many_is_refused(address):
    envs = [GenericEnvClient(base_url=address).sync() for _ in range(3)]
    try:
        for seed, env in enumerate(envs):
            env.connect()
            env.reset(seed=seed)
        envs[0].step(STOP)
        assert [env.state()["step_count"] for env in envs] == [1, 0, 0]
        with pytest.raises(ConnectionClosed), GenericEnvClient(base_url=address).sync() as late:
            late.reset(seed=0)
    finally:
        for env in envs:
            env.close()


def test_the_tools_of_mcp_clients_are_the_skills(address):
    with MCPToolClient(base_url=address).sync() as env:
        env.reset(seed=0)
        walk = next(tool for tool in env.list_tools() if tool.name == "walk")
        assert next(iter(walk.input_schema["properties"])) == "thoughts"
        done = env.step(CallToolAction(tool_name="walk", arguments={"z_cm": "far"}))
        assert "walk" in done.observation.result[0]["text"]
        assert done.reward == 0


def test_another_host_name_is_refused(address):
    assert requests.get(f"{address}/health", headers={"Host": "evil.example"}).status_code == 400
