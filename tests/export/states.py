"""Comparison of pictures of engines with the preview, and faulty copies of exports."""

import json
import shutil

import numpy as np
import pytest

from tools.engines import cornell

#: Width and height of the pictures, pixels.
WIDTH = 240


def close_enough(picture, wanted):
    """99 % of the pixels are within 2 %, and the mean within 1 %."""
    assert picture.mean() == pytest.approx(wanted.mean(), rel=0.01)
    assert np.percentile(cornell.differences(picture, wanted), 99) < 0.02


def changed(folder, path, change):
    """Copy an export to a folder, and change its manifest; return the path of the copied glTF file."""
    for file in path.parent.glob("room*"):
        shutil.copy2(file, folder)
    manifest = json.loads((path.parent / "hemibake.json").read_text())
    change(manifest)
    (folder / "hemibake.json").write_text(json.dumps(manifest))
    return folder / path.name
