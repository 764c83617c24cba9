# /// script
# dependencies = ["smolagents[mcp,openai]==1.26.0", "mcp[ws]==1.30.0"]
# ways = ["body.tools", "HTTP", "stdio"]
# ///
"""smolagents: its tool-calling agent asks the model and calls the tools; a callback shows the model the pictures of
body.tools."""

from connection import ARGS, COMMAND, MODEL, SERVED, TASK, URL
from mcp import StdioServerParameters
from smolagents import MCPClient, OpenAIModel, ToolCallingAgent

from humanclaw import Body


def answer(tools, **options):
    model = OpenAIModel("scripted", api_base=MODEL, api_key="unused")
    return ToolCallingAgent(tools, model, verbosity_level=0, **options).run(TASK)


if SERVED:
    http = URL and {"url": URL, "transport": "streamable-http"}
    with MCPClient(http or StdioServerParameters(command=COMMAND, args=ARGS), structured_output=False) as tools:
        print(answer(tools))
else:
    with Body("house:0") as body:
        tools = body.tools("smolagents")
        print(answer(tools, step_callbacks=[tools.see]), body.step, "steps")
