"""Tests of the release notes: the section of one version of the changelog."""

import tomllib

import pytest

from tools.release_notes import CHANGELOG, section

TEXT = """# Changelog

## [Unreleased]

- later

## [1.10.0] - 2026-01-02

### Added

- [a link](docs/a.md)

## [1.1.0] - 2025-01-02

- first

[1.1.0]: https://example.org
"""


def test_only_one_version():
    assert section(TEXT, "1.10.0") == "### Added\n\n- [a link](docs/a.md)\n"


def test_last_version_without_link_definitions():
    assert section(TEXT, "1.1.0") == "- first\n"


def test_missing_version_is_named():
    with pytest.raises(ValueError, match=r"no section '1\.1'"):
        section(TEXT, "1.1")


def test_version_of_the_manifest_has_release_notes():
    manifest = tomllib.loads((CHANGELOG.parent / "blender_manifest.toml").read_text(encoding="utf-8"))
    notes = section(CHANGELOG.read_text(encoding="utf-8"), manifest["version"])
    assert "\n- " in notes
    assert "## [" not in notes
