"""Every rung of the ladder makes the right calls of OpenCL and hands over what was drawn."""

import numpy as np
import pyopencl as cl
import pytest

from engine.device.cl_device import ComputeDevice
from engine.errors import DeviceError
from tests.gpu.fake_sharing import FakeLibrary
from tools import gl_interop, probe_sharing
from tools.cl_library import ClLibrary

ACQUIRE, RELEASE = "clEnqueueAcquireGLObjects", "clEnqueueReleaseGLObjects"


@pytest.fixture(scope="module")
def processor():
    return ComputeDevice()


@pytest.fixture(params=["radiance", "identity"])
def texture(graphics, request):
    """A texture array of each kind that hemicubes are drawn into."""
    numbers, kind = (4, "f4") if request.param == "radiance" else (1, "u4")
    array = graphics.context.texture_array((7, 5, 3), numbers, dtype=kind)
    yield array
    graphics.discard(array)


def hands_over(graphics, compute, texture, share):
    """Draw twice: OpenCL has to see each."""
    random = np.random.default_rng(3)
    for _ in range(2):
        drawn = random.integers(0, 1 << 20, gl_interop.texture_bytes(texture) // 4).astype(np.uint32)
        texture.write(drawn.tobytes())
        seen = np.empty_like(drawn)
        cl.enqueue_copy(compute.queue, seen, share.update())
        if (seen != drawn).any():
            return False
    return graphics.context.error == "GL_NO_ERROR"


def faked(compute, texture, **options):
    fake = FakeLibrary(compute, texture, **options)
    return fake, ClLibrary(compute.device.platform.int_ptr, fake)


def waits(kind, graphics, compute, library):
    if kind == "finish":
        return gl_interop.Finish(graphics, compute)
    return gl_interop.Events(graphics, compute, library)


@pytest.mark.parametrize("kind", ["finish", "events"])
def test_texture_is_acquired_copied_and_released_each_time(graphics, processor, texture, kind):
    fake, library = faked(processor, texture)
    share = gl_interop.TextureShare(processor, library, waits(kind, graphics, processor, library), texture)
    assert hands_over(graphics, processor, texture, share)
    fence = ["clCreateEventFromGLsyncKHR"] if kind == "events" else []
    assert fake.names == ["clCreateFromGLTexture", *[*fence, ACQUIRE, RELEASE] * 2]
    assert [call[4] for call in fake.calls if call[0] == ACQUIRE] == [len(fence)] * 2


@pytest.mark.parametrize("kind", ["finish", "events"])
def test_buffer_is_opencls_until_opengl_fills_it_again(graphics, processor, texture, kind):
    fake, library = faked(processor, texture)
    handover = waits(kind, graphics, processor, library)
    share = gl_interop.BufferShare(graphics, processor, library, handover, texture)
    assert hands_over(graphics, processor, texture, share)
    names = [name for name in fake.names if name != "clCreateEventFromGLsyncKHR"]
    assert names == ["clCreateFromGLBuffer", ACQUIRE, RELEASE, ACQUIRE]
    share.release()
    share.release()
    assert fake.names[-1] == RELEASE and fake.names.count(RELEASE) == 2


def test_external_memory_is_imported_by_both(graphics, processor, texture, monkeypatch):
    """This driver has no memory to export: a buffer of OpenGL's own stands in for what it imports."""
    own, imported = graphics.context.buffer(reserve=gl_interop.texture_bytes(texture)), []

    def imported_buffer(_, *arguments):
        imported.append(arguments)
        return own.glo

    monkeypatch.setattr(gl_interop.SharingGL, "imported_buffer", imported_buffer)
    fake, library = faked(processor, texture, imported=own.glo)
    handover = gl_interop.Finish(graphics, processor)
    size = gl_interop.texture_bytes(texture)
    share = gl_interop.ExternalShare(
        graphics, processor, library, handover, texture, lambda wanted: (11, 12, max(wanted, size))
    )
    assert hands_over(graphics, processor, texture, share)
    assert imported == [(11, size, 0x9586)]
    assert fake.properties == [0x2060, 12, 0]
    assert [call[4] for call in fake.calls if call[0] == "clCreateBufferWithProperties"] == [size]
    calls = [name for name in fake.names if name.startswith("clEnqueue")]
    acquire, release = (f"clEnqueue{verb}ExternalMemObjectsKHR" for verb in ("Acquire", "Release"))
    assert calls == [acquire, release, acquire]
    share.release()
    assert fake.names[-1] == release


def test_context_names_the_opengl_context_that_is_current(graphics, processor):
    fake, library = faked(processor, None)
    graphics.use()
    properties = gl_interop.current_gl_context()
    context = gl_interop.shared_context(processor.device, library, properties)
    assert context.int_ptr == processor.context.int_ptr
    assert fake.properties == [0x1084, library.platform, 0x2008, properties[1], 0x2009, properties[3]]
    assert all(fake.properties)


@pytest.mark.parametrize("name", ["clCreateFromGLTexture", ACQUIRE, RELEASE])
def test_refusals_name_the_call_and_the_error(graphics, processor, texture, name):
    _, library = faked(processor, texture, fails=[name])
    with pytest.raises(DeviceError, match=f"{name} fails with error -59"):
        gl_interop.TextureShare(processor, library, gl_interop.Finish(graphics, processor), texture).update()


def test_drivers_without_the_functions_are_told_apart(processor):
    library = ClLibrary(processor.device.platform.int_ptr, object())
    with pytest.raises(DeviceError, match="no function clCreateFromGLBuffer"):
        library.make("clCreateFromGLBuffer", processor.context.int_ptr, 4, 1)


def test_ladder_names_what_each_rung_lacks():
    """Of this driver, of a data-centre card's (H100, 580) and of a desktop's."""
    opengl = {"GL_EXT_memory_object", "GL_EXT_memory_object_fd"}
    card = {"cl_khr_gl_event", "cl_khr_external_memory", "cl_khr_external_memory_opaque_fd"}
    lacks = {rung: gl_interop.missing_extensions(rung, card, opengl) for rung in gl_interop.RUNGS}
    assert lacks["texture"] == lacks["buffer"] == ("cl_khr_gl_sharing",)
    assert lacks["external memory"] == lacks["host"] == ()
    assert gl_interop.missing_extensions("external memory", card, set()) == tuple(sorted(opengl))
    for name in ("cl_khr_gl_sharing", "cl_APPLE_gl_sharing"):
        assert gl_interop.missing_extensions("texture", {name}, set()) == ()


def test_probe_tells_where_the_time_of_an_iteration_goes(graphics, processor):
    rows = probe_sharing.iteration(graphics, processor, 3)
    for way, count in ("OpenGL", 2), ("OpenCL", 3):
        parts = [row for row in rows if row[0].startswith(way)]
        assert len(parts) == count and all(ms > 0 for _, ms, _ in parts)
        assert abs(sum(float(share.rstrip("%")) for *_, share in parts) - 100) < 0.2
