"""What several unit tests need."""

from pathlib import Path

import pytest
from phototaxis_sim import arenas


@pytest.fixture
def quiet(tmp_path):
    """The paper's arena without noise."""
    text = (Path(arenas.__file__).parent / "arenas/paper.toml").read_text()
    file = tmp_path / "quiet.toml"
    file.write_text(text.replace("noise = 0.05", "noise = 0.0"))
    return str(file)
