# /// script
# dependencies = ["google-genai==3.4.0"]
# dialect = "GeminiServer"
# ways = ["body.tools"]
# ///
"""Google's client: ask the model, answer its calls, until it has none."""

from connection import MODEL, TASK
from google import genai
from google.genai import types

from humanclaw import Body

where = MODEL.removesuffix("/v1beta")
client = genai.Client(api_key="unused", http_options=types.HttpOptions(base_url=where))
contents = [types.Content(role="user", parts=[types.Part(text=TASK)])]
with Body("house:0") as body:
    tools = body.tools("google")
    config = types.GenerateContentConfig(tools=tools)
    while True:
        response = client.models.generate_content(model="scripted", contents=contents, config=config)
        if not response.function_calls:
            break
        contents += [response.candidates[0].content, *tools.answer(response)]
    print(response.text, body.step, "steps")
