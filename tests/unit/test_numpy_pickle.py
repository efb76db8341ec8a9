"""Pickles between processes with different NumPy versions."""

import pickle
import pickletools

import numpy as np
import pytest

from engine import Settings
from engine.numpy_pickle import NumpyPickle, portable_bytes
from engine.postprocess.texel_samples import no_samples
from tests.analytic.scenes import nine_quad_room


class Sent(NumpyPickle):
    def __init__(self, **values):
        self.__dict__.update(values)


RECORDS = np.zeros(3, [("at", np.float32, 3), ("index", np.int32)])
RECORDS["at"][1] = np.nan


@pytest.mark.parametrize("values", [
    np.arange(21, dtype=np.float16).reshape(7, 3)[::-2],
    np.asfortranarray(np.arange(35.0).reshape(5, 7)),
    np.zeros((0, 3), np.float32),
    np.array(-0.0),
    np.array([True, False]),
    np.array(["a", "Wände"]),
    np.arange(3, dtype=">u4"),
    RECORDS,
])  # fmt: skip
def test_arrays_arrive_as_they_were(values):
    found = pickle.loads(pickle.dumps(Sent(values=values))).values
    assert found.dtype == values.dtype and found.shape == values.shape
    assert found.tobytes() == values.tobytes()
    found[...] = found


def test_numbers_and_what_is_nested_arrive_as_they_were():
    sent = Sent(unit=np.float32(0.1), deep=[{"light": (np.ones(2), np.int64(3))}, None], text="x")
    found = pickle.loads(pickle.dumps(sent))
    assert type(found.unit) is np.float32 and found.unit == np.float32(0.1)
    (ones, three), text = found.deep[0]["light"], found.text
    assert ones.tolist() == [1, 1] and type(three) is np.int64 and (three, text) == (3, "x")


@pytest.mark.parametrize("sent", [
    pickle.dumps(no_samples(), 5),
    pickle.dumps(Sent(unit=np.float32(1), array=np.ones(3)), 5),
    portable_bytes((nine_quad_room(), Settings())),
])  # fmt: skip
def test_no_pickle_names_a_module_of_numpy(sent):
    assert not numpy_names(sent)


def test_an_ordinary_pickle_does():
    """Else the test above could not fail."""
    assert numpy_names(pickle.dumps(np.ones(3), 5))


def numpy_names(data):
    """Return what a pickle, and those in it, name that holds NumPy's name."""
    found = []
    for _, argument, _ in pickletools.genops(data):
        if isinstance(argument, str) and argument.startswith("numpy"):
            found.append(argument)
        elif isinstance(argument, bytes) and argument[:1] == b"\x80":
            found += numpy_names(argument)
    return found
