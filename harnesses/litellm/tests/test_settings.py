"""Settings of agent and verifier, without a server."""

from humanclaw_litellm.settings import Settings


def test_a_verifier_with_its_own_model_gets_no_other_providers_key():
    options = {"model": "a/x", "api_base": "http://127.0.0.1:8001", "auth_env": "A_KEY"}
    shared = Settings.of_verifier(options)
    apart = Settings.of_verifier(options | {"verifier_model": "b/y"})
    assert (shared.model, shared.api_base, shared.auth_env) == ("a/x", "http://127.0.0.1:8001", "A_KEY")
    assert (apart.model, apart.api_base, apart.auth_env) == ("b/y", "", "")
