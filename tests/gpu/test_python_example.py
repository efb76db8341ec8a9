"""Tests that the example of docs/reference/python.md runs as it stands there, and that its light is right."""

import re
from pathlib import Path

import numpy as np

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "python.md"


def test_example_of_the_python_page(capsys):
    """A floor under a sky of radiance 2 receives an irradiance of 2 pi."""
    text = PAGE.read_text(encoding="utf-8")
    (code,) = re.findall(r"<!-- example: .*? -->\n```python\n(.*?)```", text, re.DOTALL)
    names: dict = {}
    exec(compile(code, str(PAGE), "exec"), names)
    np.testing.assert_allclose(names["lightmap"], 2.0, rtol=1e-5)
    assert capsys.readouterr().out == f"{names['lightmap'].mean()} ()\n"
