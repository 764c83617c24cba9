"""Helpers for the tests of skills, plugins and harnesses."""

from __future__ import annotations

from typing import TYPE_CHECKING

from humanclaw._lazy import lazy

if TYPE_CHECKING:
    from humanclaw.testing.contract import Report, check_skill, check_target, examine
    from humanclaw.testing.dialects import AnthropicServer, GeminiServer, OllamaServer, ResponsesServer, VLLMServer
    from humanclaw.testing.fakes import FakeGenerator, FakeModel, FakeRenderer, FakeWorld, fake_body, fake_scene
    from humanclaw.testing.openai_server import (
        OpenAIServer,
        Reply,
        Request,
        call,
        calls,
        delayed,
        dropped,
        message,
        no_choices,
        redirected,
        refusing,
        refusing_images,
        status,
        streaming_only,
        text,
        thinking,
        truncated,
        without_usage,
    )
    from humanclaw.testing.sampling import corners, legal_calls
    from humanclaw.testing.scenes import SceneBuilder
    from humanclaw.testing.scripted import ScriptedAgent
    from humanclaw.testing.simulators import SimulatorConformance
    from humanclaw.testing.speed import reset_times, resident
    from humanclaw.testing.steps import check, contacts, touches

_HOMES = {
    "check": "steps",
    "contacts": "steps",
    "touches": "steps",
    "AnthropicServer": "dialects",
    "FakeGenerator": "fakes",
    "FakeModel": "fakes",
    "FakeRenderer": "fakes",
    "FakeWorld": "fakes",
    "GeminiServer": "dialects",
    "OllamaServer": "dialects",
    "OpenAIServer": "openai_server",
    "Reply": "openai_server",
    "Report": "contract",
    "Request": "openai_server",
    "ResponsesServer": "dialects",
    "SceneBuilder": "scenes",
    "ScriptedAgent": "scripted",
    "SimulatorConformance": "simulators",
    "VLLMServer": "dialects",
    "call": "openai_server",
    "calls": "openai_server",
    "check_skill": "contract",
    "check_target": "contract",
    "corners": "sampling",
    "examine": "contract",
    "fake_body": "fakes",
    "fake_scene": "fakes",
    "legal_calls": "sampling",
    "delayed": "openai_server",
    "dropped": "openai_server",
    "message": "openai_server",
    "no_choices": "openai_server",
    "redirected": "openai_server",
    "refusing": "openai_server",
    "refusing_images": "openai_server",
    "reset_times": "speed",
    "resident": "speed",
    "status": "openai_server",
    "streaming_only": "openai_server",
    "text": "openai_server",
    "thinking": "openai_server",
    "truncated": "openai_server",
    "without_usage": "openai_server",
}
__all__ = [
    "AnthropicServer",
    "FakeGenerator",
    "FakeModel",
    "FakeRenderer",
    "FakeWorld",
    "GeminiServer",
    "OllamaServer",
    "OpenAIServer",
    "Reply",
    "Report",
    "Request",
    "ResponsesServer",
    "SceneBuilder",
    "ScriptedAgent",
    "SimulatorConformance",
    "VLLMServer",
    "call",
    "calls",
    "check",
    "check_skill",
    "check_target",
    "contacts",
    "corners",
    "delayed",
    "dropped",
    "examine",
    "fake_body",
    "fake_scene",
    "legal_calls",
    "message",
    "no_choices",
    "redirected",
    "refusing",
    "refusing_images",
    "reset_times",
    "resident",
    "status",
    "streaming_only",
    "text",
    "thinking",
    "touches",
    "truncated",
    "without_usage",
]
__getattr__ = lazy(__name__, _HOMES)
