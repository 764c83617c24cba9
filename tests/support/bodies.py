"""Fixtures that are slow to make. Tests share them safely because each test resets what it uses."""

import pytest

from humanclaw import Body, Plugins


@pytest.fixture(scope="session")
def plugins():
    return Plugins.discover()


@pytest.fixture(scope="session")
def house(plugins):
    return plugins.scene("house:0")


@pytest.fixture(scope="session")
def body(plugins, house):
    with Body(house, plugins=plugins) as made:
        yield made
