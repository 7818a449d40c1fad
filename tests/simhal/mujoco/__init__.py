"""The world in MuJoCo; without the engine the whole folder is skipped, and says so."""

import pytest

pytest.importorskip("mujoco", reason="mujoco is not installed; pip install 'wayfarer-rover[physics]'")
