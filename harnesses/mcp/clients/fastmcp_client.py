# /// script
# dependencies = ["fastmcp==4.1.2", "openai==3.52.0"]
# ///
"""The FastMCP client with a minimal agent."""

import asyncio
import os
import sys

from fastmcp import Client
from fastmcp.client.transports import StdioTransport
from plain_agent import drive


def server():
    if "MCP_URL" in os.environ:
        return os.environ["MCP_URL"]
    command, *args = sys.argv[1:]
    return StdioTransport(command, args)


async def main():
    async with Client(server()) as client:
        tools = [(tool.name, tool.description, tool.input_schema) for tool in await client.list_tools()]

        async def call(name, arguments):
            return (await client.call_tool(name, arguments, raise_on_error=False)).content

        print(await drive(tools, call))


asyncio.run(main())
