# /// script
# dependencies = ["langchain==1.4.7", "langchain-openai==1.7.3"]
# ///
"""LangChain: its agent (a LangGraph graph) asks the model and calls the tools."""

import os

from langchain.agents import create_agent
from langchain_openai import ChatOpenAI

from humanclaw import Body

model = ChatOpenAI(model="scripted", base_url=os.environ["MODEL_URL"], api_key="unused")
with Body("house:0") as body:
    agent = create_agent(model, body.tools("langchain"))
    answer = agent.invoke({"messages": [{"role": "user", "content": os.environ["TASK"]}]})
    print(answer["messages"][-1].content, body.step, "steps")
