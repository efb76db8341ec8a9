"""Images of each alpha mode against Cycles' EMIT bake of an Image Texture."""

import numpy as np
import pytest

from engine.scene.color import srgb_to_linear
from tests.blender.things import material, part, square

#: Colours and alphas of four texels; of some premultiplied colours would be larger than alpha.
_PIXELS = np.float32(
    [[0.8, 0.4, 0.2, 0.5], [0.1, 0.3, 0.25, 0.25], [0.6, 0.2, 0.9, 1], [0.3, 0.3, 0.1, 0.75]]
)


def save(path, exr):
    """Write the texels into a file without a conversion."""
    import bpy

    image = bpy.data.images.new("Texels", 2, 2, alpha=True, float_buffer=exr, is_data=True)
    image.alpha_mode = "CHANNEL_PACKED"
    image.pixels.foreach_set(_PIXELS.ravel())
    scene = bpy.data.scenes.new("Format")
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_mode = ("OPEN_EXR" if exr else "PNG"), "RGBA"
    if exr:
        settings.color_depth = "32"
        image.save_render(str(path), scene=scene)
    else:
        image.filepath_raw, image.file_format = str(path), "PNG"
        image.save()
    bpy.data.scenes.remove(scene)
    bpy.data.images.remove(image)


def texture(surface, image, alpha_linked):
    """Let a material emit the Color of an image; return the node, and what emits."""
    tree = surface.node_tree
    tree.nodes.clear()
    names = ("OutputMaterial", "MixShader", "Emission", "Emission")
    output, mix, emission, other = (tree.nodes.new(f"ShaderNode{name}") for name in names)
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image, node.interpolation = image, "Closest"
    for shader, socket in zip((emission, other), mix.inputs[1:3], strict=True):
        tree.links.new(node.outputs["Color"], shader.inputs["Color"])
        tree.links.new(shader.outputs[0], socket)
    tree.links.new((mix if alpha_linked else emission).outputs[0], output.inputs["Surface"])
    if alpha_linked:
        tree.links.new(node.outputs["Alpha"], mix.inputs[0])
    return node, emission


def emitted(obj):
    """Bake an object's emission with Cycles; return it, (4, 3) float32."""
    import bpy

    tree = obj.active_material.node_tree
    image = bpy.data.images.new("Target", 2, 2, float_buffer=True, is_data=True)
    target = tree.nodes.new("ShaderNodeTexImage")
    target.image = image
    tree.nodes.active = target
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.samples = "CYCLES", 1
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    bpy.ops.object.bake(type="EMIT", margin=0)
    pixels = np.empty(16, np.float32)
    image.pixels.foreach_get(pixels)
    tree.nodes.remove(target)
    bpy.data.images.remove(image)
    return pixels.reshape(4, 4)[:, :3]


def read(node, output):
    """Return the texels of an output, (4, 3 or 1) float32 scene-linear."""
    textures, pixels = part("operators.scene.materials.textures"), part("operators.scene.materials.pixels")
    cache = pixels.PixelCache([])
    channels = 3 if output == "Color" else 1
    while True:
        try:
            found = textures.read_texture(node.outputs[output], cache, "Test", channels)
            break
        except pixels.PixelsNeededError as unread:
            for _ in unread.reading:
                pass
    values = found.pixels.reshape(4, -1)
    return srgb_to_linear(values) if found.srgb else values


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize(
    ("name", "space"),
    [("t.png", "sRGB"), ("t.png", "Non-Color"), ("t.exr", "Linear Rec.709"), ("t.exr", "Non-Color")],
)
def test_colour_and_alpha_are_those_of_cycles(name, space, packed, tmp_path):
    import bpy

    obj = square(surface=material())
    save(tmp_path / name, name.endswith("exr"))
    for mode in ("STRAIGHT", "PREMUL", "CHANNEL_PACKED", "NONE"):
        image = bpy.data.images.load(str(tmp_path / name), check_existing=False)
        image.colorspace_settings.name, image.alpha_mode = space, mode
        if packed:
            image.pack()
        images = len(bpy.data.images)
        for linked in (False, True):
            node, emission = texture(obj.active_material, image, linked)
            assert np.abs(read(node, "Color") - emitted(obj)).max() < 0.02, (mode, linked)
        node, emission = texture(obj.active_material, image, False)
        alpha = read(node, "Alpha")
        node.id_data.links.new(node.outputs["Alpha"], emission.inputs["Color"])
        assert np.abs(alpha - emitted(obj)).max() < 0.005, mode
        assert len(bpy.data.images) == images
