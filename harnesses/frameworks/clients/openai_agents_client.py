# /// script
# dependencies = ["openai-agents==0.24.0"]
# dialect = "ResponsesServer"
# ways = ["body.tools", "HTTP", "stdio"]
# ///
"""OpenAI's Agents SDK: its runner asks the model, by the Responses API as it does by default, and calls the tools."""

import asyncio

from agents import Agent, OpenAIResponsesModel, Runner, set_tracing_disabled
from agents.mcp import MCPServerStdio, MCPServerStreamableHttp
from connection import ARGS, COMMAND, MODEL, SERVED, TASK, URL
from openai import AsyncOpenAI

from humanclaw import Body


async def answer(**tools):
    model = OpenAIResponsesModel("scripted", AsyncOpenAI(base_url=MODEL, api_key="unused"))
    return (await Runner.run(Agent("walker", model=model, **tools), TASK)).final_output


async def served():
    patient = {"client_session_timeout_seconds": 120}
    http = URL and MCPServerStreamableHttp({"url": URL}, **patient)
    async with http or MCPServerStdio({"command": COMMAND, "args": ARGS}, **patient) as body:
        print(await answer(mcp_servers=[body]))


set_tracing_disabled(True)
if SERVED:
    asyncio.run(served())
else:
    with Body("house:0") as body:
        print(asyncio.run(answer(tools=body.tools("openai_agents"))), body.step, "steps")
