# /// script
# dependencies = ["mcp==2.3.0", "openai==3.52.0"]
# ways = ["HTTP", "stdio"]
# ///
"""The official Python client with a minimal agent: ask the model and call its tools until it calls none."""

import asyncio

from connection import ARGS, COMMAND, URL
from mcp import Client
from mcp.client.stdio import StdioServerParameters
from plain_agent import drive


async def main():
    async with Client(URL or StdioServerParameters(command=COMMAND, args=ARGS)) as client:
        tools = [(tool.name, tool.description, tool.input_schema) for tool in (await client.list_tools()).tools]

        async def call(name, arguments):
            return (await client.call_tool(name, arguments)).content

        print(await drive(tools, call))


asyncio.run(main())
