# /// script
# dependencies = ["smolagents[mcp,openai]==1.26.0", "mcp[ws]==1.30.0"]
# ///
"""smolagents: its tool-calling agent asks the model and calls the tools."""

import os
import sys

from mcp import StdioServerParameters
from smolagents import MCPClient, OpenAIModel, ToolCallingAgent

TASK, MODEL = os.environ["TASK"], os.environ["MODEL_URL"]


def server():
    if "MCP_URL" in os.environ:
        return {"url": os.environ["MCP_URL"], "transport": "streamable-http"}
    command, *args = sys.argv[1:]
    return StdioServerParameters(command=command, args=args)


with MCPClient(server(), structured_output=False) as tools:
    model = OpenAIModel("scripted", api_base=MODEL, api_key="unused")
    print(ToolCallingAgent(tools, model, verbosity_level=0).run(TASK))
