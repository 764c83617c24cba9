"""Plugins made of a few hooks."""

from humanclaw import Plugins, hookimpl


def plugin(**hooks):
    """Make a plugin of hooks such as skills=function, or skills=[what is registered, a tuple an item of several
    arguments]. Names in capitals, such as HUMANCLAW_API, are kept."""
    own = {name: value for name, value in hooks.items() if name.isupper()}
    made = {f"humanclaw_{name}": staticmethod(_hook(it)) for name, it in hooks.items() if name not in own}
    return type("Plugin", (), own | made)()


def _hook(it):
    if callable(it):
        return hookimpl(it)
    return hookimpl(lambda register: [register(*one) if isinstance(one, tuple) else register(one) for one in it])


def host_of(owner, **hooks):
    """Return a host with one such plugin."""
    plugins = Plugins()
    plugins.add(plugin(**hooks), owner)
    return plugins


def raising(error):
    """Return a hook that raises an error."""

    def hook(register):
        raise error

    return hook
