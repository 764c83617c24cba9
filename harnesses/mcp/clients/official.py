# /// script
# dependencies = ["mcp==2.3.0", "openai==3.52.0"]
# ///
"""The official Python client with a minimal agent: ask the model and call its tools until it calls none."""

import asyncio
import os
import sys

from mcp import Client
from mcp.client.stdio import StdioServerParameters
from plain_agent import drive


def server():
    if "MCP_URL" in os.environ:
        return os.environ["MCP_URL"]
    command, *args = sys.argv[1:]
    return StdioServerParameters(command=command, args=args)


async def main():
    async with Client(server()) as client:
        tools = [(tool.name, tool.description, tool.input_schema) for tool in (await client.list_tools()).tools]

        async def call(name, arguments):
            return (await client.call_tool(name, arguments)).content

        print(await drive(tools, call))


asyncio.run(main())
