"""Plugins made of a few hooks, and distributions of plugins."""

import textwrap

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
    return hookimpl(lambda register: [register(*item) if isinstance(item, tuple) else register(item) for item in it])


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


def write_distribution(folder, name, module, code, requires="humanclaw"):
    """An installed distribution as pip leaves it: a module, and metadata that names it as an entry point."""
    (folder / f"{module}.py").write_text(textwrap.dedent(code))
    info = folder / f"{name.replace('-', '_')}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\nRequires-Dist: {requires}\n")
    (info / "entry_points.txt").write_text(f"[humanclaw]\n{module} = {module}\n")
