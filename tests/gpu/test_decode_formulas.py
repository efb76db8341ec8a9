"""Decoders that the manifest and the documentation give to engines, run as GLSL."""

from pathlib import Path

import numpy as np
import pytest

from engine.encoding.logluv import LogLuv
from engine.encoding.rgbd import Rgbd
from engine.encoding.rgbe import Rgbe
from engine.encoding.rgbm import Rgbm
from engine.encoding.signed_norm import SignedNorm
from engine.encoding.srgb import Srgb

ROOT = Path(__file__).resolve().parents[2]

ENCODINGS = [
    Srgb(-3.7),
    Srgb(1.3, 16),
    Rgbm(34.493242),
    Rgbm(64.0, 2.0),
    Rgbd(255.0),
    Rgbd(7.1, 1.0),
    LogLuv(),
    Rgbe(),
    SignedNorm(7.5),
    SignedNorm(1e-3, 8),
]

_SHADER = """\
#version 330
in vec4 texel;
uniform float intensity;
out vec3 result;
{functions}
void main() {{
    vec3 rgb = texel.rgb, light;
    float a = texel.a;
    {decode};
    result = light;
}}
"""


def decoded(graphics, texels: np.ndarray, intensity: float, decode: str, functions: str = "") -> np.ndarray:
    """Decode texels, (n, channels) uint8 or uint16, by a GLSL decoder; return (n, 3) float32."""
    context = graphics.context
    inputs = np.ones((len(texels), 4), np.float32)
    inputs[:, : texels.shape[1]] = texels / np.iinfo(texels.dtype).max
    source = _SHADER.format(functions=functions, decode=decode)
    with context:
        program = context.program(vertex_shader=source, varyings=["result"])
        if "intensity" in program:
            program["intensity"] = intensity
        given, taken = context.buffer(inputs.tobytes()), context.buffer(reserve=12 * len(inputs))
        array = context.vertex_array(program, [(given, "4f", "texel")])
        target = context.simple_framebuffer((1, 1))
        target.use()
        array.transform(taken, context.POINTS, vertices=len(inputs))
        result = np.frombuffer(taken.read(), np.float32).reshape(-1, 3)
        for thing in (array, target, given, taken, program):
            thing.release()
    return result


def texels_of(encoding) -> np.ndarray:
    """Return texels, (n, c), of light over three decades, of black, and of both signs if there are two."""
    generator = np.random.default_rng(8)
    light = 10 ** generator.uniform(-3, 0, (1, 1009, 3)) * min(encoding.largest, 10.0)
    light[0, 7] = 0
    if isinstance(encoding, SignedNorm):
        light[0, ::2] *= -1
    return encoding.encode(light.astype(np.float32))[0]


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_formula_of_the_manifest_runs_as_glsl_and_decodes(graphics, encoding):
    texels = texels_of(encoding)
    wanted = encoding.decode(texels[None])[0]
    light = decoded(graphics, texels, encoding.intensity, encoding.formula)
    assert light == pytest.approx(wanted, rel=1e-4, abs=2e-6 * np.abs(wanted).max())


def test_function_of_the_documentation_decodes_logluv(graphics):
    text = (ROOT / "docs" / "reference" / "formats.md").read_text(encoding="utf-8")
    function = text.partition("```glsl\n")[2].partition("```")[0]
    texels = texels_of(LogLuv())
    wanted = LogLuv().decode(texels[None])[0]
    light = decoded(graphics, texels, 1.0, "light = decodeLogLuv(texel)", function)
    assert light == pytest.approx(wanted, rel=1e-4, abs=2e-6 * wanted.max())
