# /// script
# dependencies = ["fastmcp==4.1.2", "openai==3.52.0"]
# ways = ["HTTP", "stdio"]
# ///
"""The FastMCP client with a minimal agent."""

import asyncio

from connection import ARGS, COMMAND, URL
from fastmcp import Client
from fastmcp.client.transports import StdioTransport
from plain_agent import drive


async def main():
    async with Client(URL or StdioTransport(COMMAND, ARGS)) as client:
        tools = [(tool.name, tool.description, tool.input_schema) for tool in await client.list_tools()]

        async def call(name, arguments):
            return (await client.call_tool(name, arguments, raise_on_error=False)).content

        print(await drive(tools, call))


asyncio.run(main())
