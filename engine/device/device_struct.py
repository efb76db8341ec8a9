"""Structs shared by host and device: one description yields the NumPy dtype and the C struct."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

#: Valid field types: NumPy type and shape. Kernels read three floats with vload3.
_TYPES: dict[str, tuple[type[np.generic], tuple[int, ...]]] = {
    "float": (np.float32, ()),
    "int": (np.int32, ()),
    "float[3]": (np.float32, (3,)),
    "int[2]": (np.int32, (2,)),
}

#: Alignment of structs in bytes; devices then load four numbers at once.
_ALIGNMENT = 16

#: Type, name, and unit and meaning of a field.
Field = tuple[str, str, str]


class DeviceStruct:
    """C struct with the NumPy dtype of the same layout.

    name:         name of the struct
    dtype:        structured dtype; fields with several components have shape (3,) or (2,)
    declaration:  declaration of the struct in OpenCL C

    All numbers have four bytes, so there are no gaps between fields. A vector and the number after it are
    loaded together if they start at a multiple of 16 bytes. Padding at the end is a field too.
    """

    def __init__(self, name: str, *fields: Field) -> None:
        self.name = name
        members = [(field, *_TYPES[kind]) for kind, field, _ in fields]
        lines = [f"    {_declared(kind, field)};  // {meaning}" for kind, field, meaning in fields]
        missing = -np.dtype(members).itemsize % _ALIGNMENT // 4
        if missing:
            members.append(("padding", np.int32, (missing,)))
            lines.append(f"    int padding[{missing}];")
        self.dtype = np.dtype(members)
        end = f"}} __attribute__((aligned({_ALIGNMENT}))) {name};"
        self.declaration = "\n".join(["typedef struct {", *lines, end, ""])
        self.glsl = "\n".join([f"struct {name} {{", *lines, "};", ""]).replace(" uniform;", " uniform_;")

    def array(self, count: int, **values: object) -> np.ndarray:
        """Return structs with fields set to one value or one value each; other fields are 0."""
        records = np.zeros(count, self.dtype)
        for name, value in values.items():
            records[name] = value
        return records

    def joined(self, arrays: Sequence[np.ndarray]) -> np.ndarray:
        """Concatenate arrays of structs; np.concatenate would take 0.1 ms to compare each pair of dtypes."""
        return np.concatenate([records.view(np.uint8) for records in arrays]).view(self.dtype)


def _declared(kind: str, name: str) -> str:
    """Return the declaration of a field in C."""
    scalar, bracket, count = kind.partition("[")
    return f"{scalar} {name}{bracket}{count}"
