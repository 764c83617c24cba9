# /// script
# dependencies = ["openai-agents==0.24.0"]
# ///
"""OpenAI Agents SDK: its runner asks the model and calls the tools."""

import asyncio
import os
import sys

from agents import Agent, OpenAIChatCompletionsModel, Runner, set_tracing_disabled
from agents.mcp import MCPServerStdio, MCPServerStreamableHttp
from openai import AsyncOpenAI

TASK, MODEL = os.environ["TASK"], os.environ["MODEL_URL"]


def server():
    if "MCP_URL" in os.environ:
        return MCPServerStreamableHttp({"url": os.environ["MCP_URL"]}, client_session_timeout_seconds=120)
    command, *args = sys.argv[1:]
    return MCPServerStdio({"command": command, "args": args}, client_session_timeout_seconds=120)


async def main():
    set_tracing_disabled(True)
    # This model leaves the pictures of tools out of its requests, since OpenAI's chat completions take none in a tool's
    # answer; the SDK's models for the Responses API and for litellm pass them on.
    model = OpenAIChatCompletionsModel("scripted", AsyncOpenAI(base_url=MODEL, api_key="unused"))
    async with server() as body:
        agent = Agent("walker", instructions=TASK, mcp_servers=[body], model=model)
        print((await Runner.run(agent, TASK)).final_output)


asyncio.run(main())
