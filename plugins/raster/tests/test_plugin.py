"""Discovery of the plugin, and the place where its machine code is cached."""

import os
import subprocess
import sys

import pytest

from humanclaw_raster.renderer import RasterRenderer

pytestmark = pytest.mark.integration


def test_the_renderer_is_found_under_its_name(plugins):
    assert isinstance(plugins.make("renderers", "raster"), RasterRenderer)


def test_importing_the_plugin_does_not_load_the_compiler():
    code = "import sys, humanclaw_raster; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_it_works_where_no_cache_can_be_written(tmp_path):
    """A file instead of a folder: nobody, not even root, can write below it."""
    blocked = tmp_path / "file"
    blocked.touch()
    code = (
        "import numpy as np; from humanclaw_raster import packing; texels = np.zeros(1, np.int32); "
        "packing._fill(np.ones(3, np.uint8), np.array([[0, 1, 1]], np.int32), texels); print(texels)"
    )
    surroundings = os.environ | {"NUMBA_CACHE_DIR": str(blocked / "cache")}
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True, env=surroundings)
    assert done.stdout == "[65793]\n", done.stderr
