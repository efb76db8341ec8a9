"""Glass of glTF materials as alpha blending."""

import pytest

from tests.blender.things import part


def glass(color, texture=None):
    """Return a material named Glass with full transmission and the index of refraction 1.5."""
    from io_scene_gltf2.io.com import gltf2_io
    from io_scene_gltf2.io.com.gltf2_io_extensions import Extension

    factors = gltf2_io.MaterialPBRMetallicRoughness(color, texture, None, None, None, None, None)
    name = "KHR_materials_transmission"
    extensions = {name: Extension(name, {"transmissionFactor": 1.0}, required=False)}
    return gltf2_io.Material(None, "OPAQUE", None, None, None, extensions, None, "Glass", None, None, factors)


@pytest.mark.parametrize("cover", [1.0, 0.25])
def test_glass_keeps_its_alpha(hemibake, cover):
    """Behind it is (1 - cover) + cover x sqrt(color) x 0.96 of the light in the darkest channel."""
    material = glass([0.25, 0.25, 1.0, cover])
    assert part("operators.gltf.clear_materials").blend_clear_materials([material]) == []
    *color, alpha = material.pbr_metallic_roughness.base_color_factor
    assert material.alpha_mode == "BLEND"
    assert 1 - alpha == pytest.approx((1 - cover) + cover * 0.48)
    assert color == pytest.approx([0.0, 0.0, 0.48 / 0.52])


def test_a_material_on_several_lightmaps_is_named_once(hemibake):
    materials = [glass([1.0, 1.0, 1.0, 1.0], texture=object()) for _ in range(2)]
    assert part("operators.gltf.clear_materials").blend_clear_materials(materials) == ["Glass"]
