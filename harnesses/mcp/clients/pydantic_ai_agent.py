# /// script
# dependencies = ["pydantic-ai-slim[mcp,openai]==2.68.0"]
# ///
"""Pydantic AI: its agent asks the model and calls the tools."""

import asyncio
import os
import sys

from fastmcp.client.transports import StdioTransport
from pydantic_ai import Agent
from pydantic_ai.mcp import MCPToolset
from pydantic_ai.models.openai import OpenAIChatModel
from pydantic_ai.providers.openai import OpenAIProvider

TASK, MODEL = os.environ["TASK"], os.environ["MODEL_URL"]


def server():
    if "MCP_URL" in os.environ:
        return os.environ["MCP_URL"]
    command, *args = sys.argv[1:]
    return StdioTransport(command, args)


async def main():
    model = OpenAIChatModel("scripted", provider=OpenAIProvider(base_url=MODEL, api_key="unused"))
    agent = Agent(model, toolsets=[MCPToolset(server(), init_timeout=120, read_timeout=120)])
    async with agent:
        print((await agent.run(TASK)).output)


asyncio.run(main())
