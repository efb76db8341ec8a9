"""Faces that lie on others are removed before Cycles' light is compared."""

from tests.blender.things import mesh_object


def test_one_of_equal_faces_stays():
    """A triangle three times, in other orders and once turned over, beside others at its corners."""
    # Blender's module bmesh exists once bpy is imported.
    from tools.verification.doubled_faces import remove_doubled_faces

    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (0, 0, 1)]
    copies = [(x + 1e-9, y, z) for x, y, z in corners[:3]]
    faces = [(0, 1, 2), (6, 7, 5), (0, 2, 1), (1, 3, 2), (0, 1, 4)]
    obj = mesh_object("Doubled", [*corners, *copies], faces)
    assert remove_doubled_faces() == 2
    assert [tuple(polygon.vertices) for polygon in obj.data.polygons] == [(0, 1, 2), (1, 3, 2), (0, 1, 4)]
    assert remove_doubled_faces() == 0
