"""Scripted model servers on 127.0.0.1, for tests of anything that talks to a language model: no key, no network."""

from model_servers.dialects import *  # noqa: F403
from model_servers.openai_server import *  # noqa: F403
