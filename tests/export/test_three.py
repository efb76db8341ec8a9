"""Pixels of three.js in Chromium against Blender's preview."""

import numpy as np
import pytest

from tools.engines import cornell

_WIDTH = 240


@pytest.fixture(scope="module")
def wanted(hemibake, engine, tmp_path_factory):
    """Bake the Cornell box and return its preview."""
    cornell.bake()
    return cornell.preview(_WIDTH, tmp_path_factory.mktemp("preview"))


def shown(engine, folder, ending=".glb", kind="HDR", files=False):
    import bpy

    path = folder / f"Cornell box ü{ending}"
    assert bpy.ops.hemibake.export_for_engine(filepath=str(path), lightmaps=kind) == {"FINISHED"}
    return engine.render(path, _WIDTH, _WIDTH, cornell.HIDDEN, files)


@pytest.mark.parametrize(
    ("ending", "kind", "files"),
    [(".glb", "HDR", False), (".gltf", "HDR", False), (".glb", "PNG", False), (".glb", "HDR", True)],
)
def test_three_shows_the_preview(wanted, engine, tmp_path, ending, kind, files):
    """At silhouettes single pixels show the other side; 8 bits are coarse where it is dark."""
    picture = shown(engine, tmp_path, ending, kind, files)
    off = cornell.differences(picture, wanted)
    assert picture.mean() == pytest.approx(wanted.mean(), rel=0.01)
    assert np.percentile(off, 99) < (0.02 if kind == "HDR" else 0.5)


@pytest.mark.parametrize("output", ["directional", "spherical_harmonics"])
def test_three_shades_a_normal_map_with_directional_maps(hemibake, engine, tmp_path, output):
    """As the preview does; without the directional maps the picture is another one."""
    cornell.bake(directional=output)
    wanted = cornell.preview(_WIDTH, tmp_path)
    pictures = [shown(engine, tmp_path, files=files) for files in (True, False)]
    shaded, flat = (cornell.differences(picture, wanted) for picture in pictures)
    assert pictures[0].mean() == pytest.approx(wanted.mean(), rel=0.01)
    assert np.percentile(shaded, 99) < 0.02
    assert np.median(flat) > 0.03
