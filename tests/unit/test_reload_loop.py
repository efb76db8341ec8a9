"""Tests of the loop that reloads the extension after a change of a file."""

import importlib
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))
from reload_loop import Reloader

NAME = "reloaded_package"


@pytest.fixture
def package(tmp_path, monkeypatch) -> Path:
    """Return the folder of a package with one module, which is imported."""
    folder = tmp_path / NAME
    folder.mkdir()
    (folder / "__init__.py").write_text("from .label import TEXT\n")
    (folder / "label.py").write_text("TEXT = 'before'\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    yield folder
    for name in [name for name in sys.modules if name.startswith(NAME)]:
        del sys.modules[name]


@pytest.fixture
def reloader(package) -> Reloader:
    """Return a reloader of the enabled package."""

    def enable() -> None:
        importlib.invalidate_caches()
        importlib.import_module(NAME)

    enable()
    return Reloader([package], NAME, enable, lambda: None)


def text() -> str:
    return sys.modules[NAME].TEXT


def test_an_unchanged_package_stays(reloader):
    before = sys.modules[NAME]
    assert not reloader.step()
    assert sys.modules[NAME] is before


def test_a_changed_module_is_imported_again(reloader, package):
    """Also one that is imported by others, and only once per change."""
    (package / "label.py").write_text("TEXT = 'after the change'\n")
    assert reloader.step() and text() == "after the change"
    assert not reloader.step()


def test_other_packages_with_a_longer_name_stay(reloader, package, monkeypatch):
    monkeypatch.setitem(sys.modules, f"{NAME}_more", sys)
    (package / "new.py").write_text("")
    assert reloader.step()
    assert sys.modules[f"{NAME}_more"] is sys


def test_an_error_in_a_file_is_shown_and_the_next_change_is_loaded(reloader, package, capsys):
    (package / "label.py").write_text("TEXT = (\n")
    assert not reloader.step()
    assert "SyntaxError" in capsys.readouterr().err
    assert not reloader.step()
    (package / "label.py").write_text("TEXT = 'mended'\n")
    assert reloader.step() and text() == "mended"
