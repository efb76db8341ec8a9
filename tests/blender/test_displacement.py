"""True displacement of materials, which the report names as not baked."""

import numpy as np
import pytest

from tests.blender.things import SQUARE, bpy_link, material, mesh_object, read_scene, square


def displacing(name="Waves", method="DISPLACEMENT", muted=False):
    """Return a material whose output has a linked Displacement."""
    surface = material(name)
    tree = surface.node_tree
    node = tree.nodes.new("ShaderNodeDisplacement")
    link = tree.links.new(node.outputs[0], tree.get_output_node("CYCLES").inputs["Displacement"])
    link.is_muted = muted
    surface.displacement_method = method
    return surface


def displaced():
    """Return the objects that the report names."""
    found = [note for note in read_scene().notes if "true displacement is not baked" in note]
    assert len(found) < 2
    return found[0].objects if found else ()


@pytest.mark.parametrize(
    ("method", "muted", "told"),
    [("DISPLACEMENT", False, True), ("BOTH", False, True), ("BUMP", False, False), ("BOTH", True, False)],
)
def test_displacement_of_the_surface_is_named(method, muted, told):
    import bpy

    square("Sea", surface=displacing(method=method, muted=muted))
    square("Shore", surface=material()).location.x = 2
    copy = bpy_link(bpy.data.objects.new("Second sea", bpy.data.objects["Sea"].data))
    copy.location.x = 4
    assert displaced() == (("Sea", "Second sea") if told else ())


def test_slots_without_faces_and_overridden_materials_do_not_displace():
    import bpy

    faces = mesh_object("Plate", SQUARE, [(0, 1, 2, 3)], np.zeros((4, 2)), material())
    faces.data.materials.append(displacing())
    assert displaced() == ()
    faces.data.polygons[0].material_index = 1
    assert displaced() == ("Plate",)
    bpy.context.view_layer.material_override = material("Clay")
    assert displaced() == ()


def test_displacement_without_a_link_changes_nothing():
    surface = material()
    surface.displacement_method = "BOTH"
    square(surface=surface)
    assert displaced() == ()
