"""Parts of the checkout that the packages for Blender hold."""

from tools.packages import archive


def test_packages_hold_the_add_on_of_godot_and_no_other_client(tmp_path):
    archive._stage([], tmp_path / "source", None)
    assert [path.name for path in (tmp_path / "source" / "clients").iterdir()] == ["godot"]
