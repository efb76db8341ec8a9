"""Parts of the checkout that the packages for Blender hold."""

from tools.packages import archive


def test_packages_hold_the_add_ons_and_loaders_of_all_engines(tmp_path):
    archive._stage([], tmp_path / "source", None)
    clients = tmp_path / "source" / "clients"
    loaders = {"babylon", "bevy", "manifest", "playcanvas", "three"}
    assert {path.name for path in clients.iterdir()} == {"godot", "unity", "unreal", *loaders}
    assert not any(path.name in ("node_modules", "target") for path in clients.rglob("*"))
