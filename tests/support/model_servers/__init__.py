"""Scripted model servers on 127.0.0.1, for tests of anything that talks to a language model: no key, no network."""

import functools

import numpy as np

from humanclaw import EpisodeContext, EpisodeSpec, Observation, Plugins
from model_servers.dialects import *  # noqa: F403
from model_servers.openai_server import *  # noqa: F403
from model_servers.openai_server import OpenAIServer, call


@functools.cache
def warm_up():
    """Have an agent decide. With its first answers litellm imports most of itself, for seconds that no test counts."""
    plugins = Plugins.discover()
    with OpenAIServer([call("stop")]) as server:
        agent = plugins.make("agents", "litellm", {"model": "openai/anything", "api_base": server.url})
        spec = EpisodeSpec(id="warm", instruction="Stop.", scene="house:0")
        agent.begin(EpisodeContext(spec, plugins.skills, seed=0))
        agent.decide(Observation(0, "Stop.", np.zeros((512, 512, 3), np.uint8)), ())
