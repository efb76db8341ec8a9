"""Records have the same layout on the host and on the device, also after NumPy has handled them."""

import numpy as np
import pytest
from pyopencl.tools import match_dtype_to_c_struct

from engine.device.cl_device import ComputeDevice
from engine.device.device_struct import DeviceStruct
from engine.direct.emitters import EMITTER
from engine.direct.light_tree import LIGHT_NODE
from engine.direct.modulation import MODULATION
from engine.visibility.rays.bvh import BOX, LINK
from engine.visibility.rays.ray_tracer import TRANSMITTANCE
from engine.visibility.rays.receiver_records import RECEIVER, TEXEL_STEP
from engine.visibility.views.viewpoints import FRAME

MIXED = DeviceStruct(
    "Mixed",
    ("float", "first", "m"),
    ("float[3]", "vector", "m"),
    ("int", "number", ""),
    ("int[2]", "pair", ""),
)
RECORDS = [MIXED, RECEIVER, TEXEL_STEP, EMITTER, MODULATION, LIGHT_NODE, FRAME, BOX, LINK, TRANSMITTANCE]


@pytest.fixture(scope="module")
def device():
    return ComputeDevice().device


def declared(record):
    """Return the fields of a record's struct as a dtype, read from its declaration."""
    fields = []
    for line in record.declaration.splitlines()[1:-1]:
        kind, name = line.split("//")[0].strip(" ;").split(" ")
        name, _, count = name.partition("[")
        scalar = {"float": np.float32, "int": np.int32}[kind]
        fields.append((name, scalar, (int(count[:-1]),)) if count else (name, scalar))
    return np.dtype(fields)


@pytest.mark.parametrize("record", RECORDS, ids=lambda record: record.name)
def test_layout_is_the_devices(device, record):
    matched, _ = match_dtype_to_c_struct(device, record.name, declared(record))
    assert matched == record.dtype and matched.itemsize % 16 == 0


@pytest.mark.parametrize("record", RECORDS, ids=lambda record: record.name)
def test_layout_survives_what_numpy_does(record):
    few, many = record.array(3), record.array(5)
    for made in (
        np.concatenate([few, many]),
        many[[4, 0]],
        np.repeat(few, 7),
        np.ascontiguousarray(many[::2]),
    ):
        assert made.dtype == record.dtype


def test_joined_records_are_those_of_all_arrays():
    parts = [MIXED.array(2, number=7), MIXED.array(0), MIXED.array(3, number=[1, 2, 3], first=0.5)]
    joined = MIXED.joined(parts)
    assert joined["number"].tolist() == [7, 7, 1, 2, 3] and joined["first"].tolist() == [0, 0, 0.5, 0.5, 0.5]


def test_arrays_hold_the_values_of_fields():
    made = MIXED.array(2, vector=(1, 2, 3), number=[7, -8])
    assert made["vector"].tolist() == [[1, 2, 3]] * 2 and made["number"].tolist() == [7, -8]
    assert not made["first"].any() and not made["pair"].any()
