# /// script
# dependencies = ["langchain-mcp-adapters==0.3.2", "langchain==1.4.7", "langchain-openai==1.7.3"]
# ///
"""LangChain: its agent (a LangGraph graph) asks the model and calls the tools, all within one session."""

import asyncio
import os
import sys

from langchain.agents import create_agent
from langchain_mcp_adapters.client import MultiServerMCPClient
from langchain_mcp_adapters.tools import load_mcp_tools
from langchain_openai import ChatOpenAI

TASK, MODEL = os.environ["TASK"], os.environ["MODEL_URL"]


def connection():
    if "MCP_URL" in os.environ:
        return {"transport": "streamable_http", "url": os.environ["MCP_URL"]}
    command, *args = sys.argv[1:]
    return {"transport": "stdio", "command": command, "args": args}


async def main():
    model = ChatOpenAI(model="scripted", base_url=MODEL, api_key="unused")
    # Without session() the adapter opens a new session for each call, and each session has a body of its own.
    async with MultiServerMCPClient({"body": connection()}).session("body") as session:
        agent = create_agent(model, await load_mcp_tools(session))
        answer = await agent.ainvoke({"messages": [{"role": "user", "content": TASK}]})
    print(answer["messages"][-1].content)


asyncio.run(main())
