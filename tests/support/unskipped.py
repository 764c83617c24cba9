"""For tests whose libraries were just installed (`make gym`, `make optional`): one that is skipped fails the run."""


def pytest_sessionfinish(session):
    if session.config.pluginmanager.get_plugin("terminalreporter").stats.get("skipped"):
        session.exitstatus = 1
