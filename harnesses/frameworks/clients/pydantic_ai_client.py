# /// script
# dependencies = ["pydantic-ai-slim[mcp,openai]==2.68.0"]
# ways = ["body.tools", "HTTP", "stdio"]
# ///
"""Pydantic AI: its agent asks the model and calls the tools."""

import asyncio

from connection import ARGS, COMMAND, MODEL, SERVED, TASK, URL
from fastmcp.client.transports import StdioTransport
from pydantic_ai import Agent
from pydantic_ai.mcp import MCPToolset
from pydantic_ai.models.openai import OpenAIChatModel
from pydantic_ai.providers.openai import OpenAIProvider

from humanclaw import Body


async def answer(**tools):
    model = OpenAIChatModel("scripted", provider=OpenAIProvider(base_url=MODEL, api_key="unused"))
    async with Agent(model, **tools) as agent:
        return (await agent.run(TASK)).output


if SERVED:
    toolset = MCPToolset(URL or StdioTransport(COMMAND, ARGS), init_timeout=120, read_timeout=120)
    print(asyncio.run(answer(toolsets=[toolset])))
else:
    with Body("house:0") as body:
        print(asyncio.run(answer(tools=body.tools("pydantic_ai"))), body.step, "steps")
