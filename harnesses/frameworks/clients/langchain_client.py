# /// script
# dependencies = ["langchain==1.4.7", "langchain-openai==1.7.3", "langchain-mcp-adapters==0.3.2"]
# ways = ["body.tools", "HTTP", "stdio"]
# ///
"""LangChain: its agent (a LangGraph graph) asks the model and calls the tools."""

import asyncio

from connection import ARGS, COMMAND, MODEL, SERVED, TASK, URL
from langchain.agents import create_agent
from langchain_mcp_adapters.client import MultiServerMCPClient
from langchain_mcp_adapters.tools import load_mcp_tools
from langchain_openai import ChatOpenAI

from humanclaw import Body


async def answer(tools):
    agent = create_agent(ChatOpenAI(model="scripted", base_url=MODEL, api_key="unused"), tools)
    return (await agent.ainvoke({"messages": [{"role": "user", "content": TASK}]}))["messages"][-1].content


async def served():
    http = {"transport": "streamable_http", "url": URL}
    where = http if URL else {"transport": "stdio", "command": COMMAND, "args": ARGS}
    # Without session() the adapter opens a new session for each call, and each session has a body of its own.
    async with MultiServerMCPClient({"body": where}).session("body") as session:
        print(await answer(await load_mcp_tools(session)))


if SERVED:
    asyncio.run(served())
else:
    with Body("house:0") as body:
        print(asyncio.run(answer(body.tools("langchain"))), body.step, "steps")
