"""Parts of the checkout that the packages for Blender hold."""

from tools.packages import archive


def test_packages_hold_the_add_ons_of_engines_without_a_package_manager(tmp_path):
    archive._stage([], tmp_path / "source", None)
    clients = (tmp_path / "source" / "clients").iterdir()
    assert sorted(path.name for path in clients) == ["godot", "unity", "unreal"]
