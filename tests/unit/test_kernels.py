"""Rules for the source text of all kernels."""

import re
from pathlib import Path

import pytest

from engine.device import source
from engine.device.source import program_source
from engine.direct.emitters import EMITTER

KERNELS = sorted((Path(__file__).resolve().parents[2] / "kernels").rglob("*.cl"))

#: A line that includes a file.
INCLUDE = re.compile(r'^#include "(.+)"$', flags=re.MULTILINE)

#: An array in the memory of all, and an assignment to a part of one of its vectors, with the vector's index.
ARRAY = re.compile(r"__global [^*(),;]*\*\s*(\w+)")
PART = re.compile(r"(\w+)\[([^;=]*)\]\.[xyzws][xyzw0-9a-f]*\s*[-+*/|&]?=[^=]")


@pytest.mark.parametrize("path", KERNELS, ids=lambda path: path.stem)
def test_parts_of_vectors_are_written_by_one_work_item(path: Path) -> None:
    """Compilers write the whole vector, with what was read of its other parts: two items lose each other's.

    Whoever numbers vectors otherwise than work items are has to write them as numbers.
    """
    text = path.read_text(encoding="utf-8")
    shared = set(ARRAY.findall(text))
    written = [match.groups() for match in PART.finditer(text)]
    assert all(index.isidentifier() for array, index in written if array in shared)


def test_a_program_has_each_included_file_once_and_before_its_user() -> None:
    """Files are reached by several ways.

    Bvh_traversal.cl from direct.cl itself and from most of what it includes.
    """
    text = program_source((EMITTER, "direct.cl", "ambient_occlusion.cl"))
    assert text.count("typedef struct") > 3 and text.startswith(EMITTER.declaration)
    for first, then in (
        ("nearest_hit(", "is_crossed("),
        ("} L1;", "void add_l1("),
        ("point_of_texel(", "__kernel"),
    ):
        assert text.index(first) < text.index(then)
    assert text.count("typedef struct {\n    float4 x, y, z;\n} L1;") == 1
    assert "#include" not in text and "#pragma once" not in text


def test_every_included_file_has_a_guard_and_is_there() -> None:
    included = {name for path in KERNELS for name in INCLUDE.findall(path.read_text(encoding="utf-8"))}
    guarded = {path.name for path in KERNELS if path.read_text(encoding="utf-8").startswith("#pragma once\n")}
    assert included and included == guarded


def test_two_files_of_one_name_in_different_folders_are_an_error(tmp_path: Path, monkeypatch) -> None:
    """An include names a file without its folder, so the name must be unique."""
    for folder in ("rays", "direct"):
        (tmp_path / "twins" / folder).mkdir(parents=True)
        (tmp_path / "twins" / folder / "bvh.cl").write_text("\n", encoding="utf-8")
    monkeypatch.setattr(source, "_ROOT", tmp_path)
    with pytest.raises(ValueError, match=r"twins/: several files are named bvh\.cl"):
        source._files("twins")
