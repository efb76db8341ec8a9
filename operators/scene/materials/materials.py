"""Reads material nodes as constants and image textures, where that is exact."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import bpy
import numpy as np

from ....engine.scene.model import Material
from ....engine.scene.texture import Texture
from ....engine.scene.transmission import Fresnel
from ...compat import node_input, node_tree
from ...working_space import luminance_of
from .chains import inputs_first
from .closures import ADD, DARK, EMITTERS, GLASS, LEAST_MIRROR, MIX, PRINCIPLED, REFRACTION
from .engine_materials import Sides, to_material
from .gloss import GLOSSY, METALLIC, conductor_color, glossy_albedo, is_conductor, keeps_energy, metal_albedo
from .normal_map_reflectance import bump_factor
from .object_nodes import Dependence, Source, shown, source_of
from .pixels import PixelCache
from .ray_kinds import BOUNCE, RayKind, ray_value
from .rough_diffuse import diffuse_roughness, rough_albedo
from .sockets import ComplexError, feeding_socket
from .textures import read_texture
from .unphysical import note_surface
from .values import BLACK, HOLE, ZERO, DiffuseSurface, MaterialValue, constant

#: Reflectance that Cycles uses if no material is assigned.
_DEFAULT_GREY = np.full(3, 0.8, np.float32)

_CONSTANT_NODES = {"RGBA": "ShaderNodeRGB", "VALUE": "ShaderNodeValue"}

_MIXES = frozenset({"ShaderNodeMix", "ShaderNodeMixRGB"})

#: Shader inputs of nodes that combine shaders.
_MIXED = {ADD: slice(0, 2), MIX: slice(1, 3)}

#: Input and number of channels in which its value is read.
_Wanted = tuple[bpy.types.NodeSocket, int]

#: Math node operations that are computed on constants.
_MATH: dict[str, np.ufunc] = {
    "ADD": np.add, "SUBTRACT": np.subtract, "MULTIPLY": np.multiply, "MAXIMUM": np.maximum,
    "MINIMUM": np.minimum,
}  # fmt: skip

_COMPARISONS = frozenset({"GREATER_THAN", "LESS_THAN"})

#: Distance of the threshold from the limit of Greater Than and Less Than: a step of the engine's 16-bit maps,
#: so that values equal to the limit stay below the threshold.
_STEP = 1 / 65535


class ShaderReader:
    """Reads the shader of one material, world or light.

    owner:   name of the datablock in messages
    notes:   sentences for the user are appended here, each once
    cache:   pixels of images; without one, textures raise ComplexError
    values:  values of object-dependent nodes for the object that uses the material
    rays:    kind of ray for which Light Path and Geometry nodes are evaluated
    glass:   True if refracting closures transmit light without refraction
    """

    def __init__(
        self,
        owner: str,
        notes: list[str],
        cache: PixelCache | None = None,
        values: dict[Source, tuple[float, ...]] | None = None,
        rays: RayKind = BOUNCE,
        glass: bool = True,
    ) -> None:
        self._owner, self._notes, self._cache, self._values = owner, notes, cache, values or {}
        self._rays, self.glass = rays, glass
        self._surfaces: dict[int, DiffuseSurface] = {}
        self._numbers: dict[tuple[int, int], MaterialValue] = {}

    def surface(self, socket: bpy.types.NodeSocket) -> DiffuseSurface:
        """Return the surface of a socket's shader; black for links in a circle.

        Raises ComplexError if only Cycles can evaluate it; the reader is then useless.
        """
        if socket.as_pointer() not in self._surfaces:
            for each in inputs_first(socket, _mixed_shaders, bpy.types.NodeSocket.as_pointer):
                self._surfaces[each.as_pointer()] = BLACK
                self._surfaces[each.as_pointer()] = self._surface_of(each)
        return self._surfaces[socket.as_pointer()]

    def _surface_of(self, socket: bpy.types.NodeSocket) -> DiffuseSurface:
        """Return the surface of a socket whose mixed shaders are known."""
        output = feeding_socket(socket)
        if not output.is_output:
            return BLACK
        if output.node.bl_idname in DARK:
            return BLACK
        read = _SHADERS.get(output.node.bl_idname)
        if read is None:
            raise ComplexError(output.node.name)
        try:
            return read(self, output.node)
        except ComplexError as error:
            raise ComplexError(error.node or output.node.name) from error

    def colour(self, node: bpy.types.Node, *names: str) -> MaterialValue:
        """Return a colour input of a node; black if the node has none of the names."""
        socket = node_input(node, *names)
        return ZERO if socket is None else self._value(socket, 3)

    def number(self, node: bpy.types.Node, *names: str) -> MaterialValue:
        """Return a number input of a node as a grey; 0 if the node has none of the names."""
        socket = node_input(node, *names)
        return ZERO if socket is None else self._value(socket, 1)

    def reflectance(self, node: bpy.types.Node, *names: str) -> MaterialValue:
        """Return a reflectance input of a node times the factor of its normal map (`bump_factor`).

        The colour of a rough diffuse closure becomes its albedo; a texture then raises ComplexError.
        """
        colour = self.colour(node, *names)
        if (roughness := diffuse_roughness(node)) is not None:
            colour = constant(*rough_albedo(_plain(colour), _fraction(self._value(roughness, 1))))
        return colour if colour.is_zero else colour * bump_factor(node, self._cache, self._owner)

    def alpha(self, socket: bpy.types.NodeSocket) -> tuple[MaterialValue, float | None]:
        """Return an alpha input; if Math nodes cut it at a threshold, their input and the threshold."""
        node = _math_node(socket)
        if node is not None and node.operation == "ROUND":
            return self._value(node.inputs[0], 1), 0.5
        compared = node if node is None or node.operation in _COMPARISONS else _complemented(node)
        if compared is None:
            return self._value(socket, 1), None
        is_greater = (compared.operation == "GREATER_THAN") == (compared == node)
        image, limit = compared.inputs[:2] if is_greater else reversed(compared.inputs[:2])
        number = self._value(limit, 1).number
        if number < 0:
            raise ComplexError(compared.name)
        return self._value(image, 1), number + (_STEP if compared == node else 0)

    def _value(self, socket: bpy.types.NodeSocket, channels: int) -> MaterialValue:
        """Return the value of an input: its own one, or the output of the node linked to it."""
        wanted = socket, channels
        if _key(wanted) not in self._numbers:
            for each in inputs_first(wanted, _computed_inputs, _key):
                self._numbers[_key(each)] = ZERO
                self._numbers[_key(each)] = self._value_of(*each)
        return self._numbers[_key(wanted)]

    def _value_of(self, socket: bpy.types.NodeSocket, channels: int) -> MaterialValue:
        """Return the value of an input; the inputs of the Math and Mix nodes before it must be known."""
        output = feeding_socket(socket)
        node = output.node
        if not output.is_output or node.bl_idname == _CONSTANT_NODES.get(output.type):
            return _fitting(_constant(output), output, channels)
        source = source_of(output)
        if source in self._values:
            return _fitting(constant(*shown(output, self._values[source])), output, channels)
        by_ray = ray_value(output, self._rays)
        if by_ray is not None:
            return constant(by_ray)
        if node.bl_idname == "ShaderNodeValToRGB":
            return self._ramp(output, channels)
        if node.bl_idname == "ShaderNodeTexImage" and self._cache is not None:
            return MaterialValue(np.ones(3), read_texture(output, self._cache, self._owner, channels))
        if node.bl_idname in _MIXES:
            return self._product(node, channels)
        if node.bl_idname == "ShaderNodeMath" and node.operation in _MATH:
            operands = [self._value(factor, 1) for factor in node.inputs[:2]]
            if node.operation == "MULTIPLY" and not node.use_clamp and not all(map(_is_constant, operands)):
                return operands[0] * operands[1]
            first, second = (operand.number for operand in operands)
            number = float(_MATH[node.operation](first, second))
            return constant(min(max(number, 0.0), 1.0) if node.use_clamp else number)
        raise ComplexError(node.name)

    def _ramp(self, output: bpy.types.NodeSocket, channels: int) -> MaterialValue:
        """Return the colour or alpha of a Color Ramp node with a constant factor."""
        colour = output.node.color_ramp.evaluate(self._value(output.node.inputs["Fac"], 1).number)
        value = constant(colour[3]) if output.name == "Alpha" else constant(*colour[:3])
        return _fitting(value, output, channels)

    def _product(self, node: bpy.types.Node, channels: int) -> MaterialValue:
        """Return the product of a Mix node in mode Multiply at factor 1; raises ComplexError for others."""
        factor, *colours = _product_inputs(node)
        if factor is None or self._value(factor, 1).number != 1:
            raise ComplexError
        first, second = (self._value(colour, 3) for colour in colours)
        if channels == 3:
            return first * second
        if first.texture is None and second.texture is None:
            return constant(float(luminance_of(first.constant * second.constant)))
        if np.ptp(first.constant) or np.ptp(second.constant):
            raise ComplexError  # the luminance of a tinted texture is not that of the texture times a number
        first, second = (self._value(colour, 1) for colour in colours)
        return first * second


def _math_node(socket: bpy.types.NodeSocket) -> bpy.types.Node | None:
    """Return the Math node that feeds a socket; None for other nodes and an unlinked socket."""
    output = feeding_socket(socket)
    return output.node if output.is_output and output.node.bl_idname == "ShaderNodeMath" else None


def _complemented(node: bpy.types.Node) -> bpy.types.Node | None:
    """Return the comparison of which a Math node takes 1 - x, as glTF's alpha mode Mask is imported."""
    if node.operation != "SUBTRACT" or node.inputs[0].is_linked or node.inputs[0].default_value != 1:
        return None
    compared = _math_node(node.inputs[1])
    return compared if compared is not None and compared.operation in _COMPARISONS else None


def _mixed_shaders(socket: bpy.types.NodeSocket) -> Sequence[bpy.types.NodeSocket]:
    """Return the shader inputs of a Mix or Add Shader node that feeds a socket."""
    output = feeding_socket(socket)
    shaders = _MIXED.get(output.node.bl_idname) if output.is_output else None
    return () if shaders is None else list(output.node.inputs[shaders])


def _computed_inputs(wanted: _Wanted) -> Sequence[_Wanted]:
    """Return the inputs from which a Math, Color Ramp or Multiply node computes the value of a socket."""
    socket, channels = wanted
    output = feeding_socket(socket)
    node = output.node
    if not output.is_output:
        return ()
    if node.bl_idname == "ShaderNodeMath" and node.operation in _MATH:
        return [(factor, 1) for factor in node.inputs[:2]]
    if node.bl_idname == "ShaderNodeValToRGB":
        return [(node.inputs["Fac"], 1)]
    factor, *colours = _product_inputs(node) if node.bl_idname in _MIXES else [None]
    if factor is None or not (factor.is_linked or factor.default_value == 1):
        return ()
    return [(factor, 1), *((colour, number) for colour in colours for number in sorted({channels, 3}))]


def _product_inputs(node: bpy.types.Node) -> list[bpy.types.NodeSocket | None]:
    """Return factor and colours of a Mix node in mode Multiply that does not clamp; [None] for others."""
    is_new = node.bl_idname == "ShaderNodeMix"
    is_color = (node.data_type == "RGBA" and not node.clamp_result) if is_new else not node.use_clamp
    inputs = [socket for socket in node.inputs if socket.enabled]
    return inputs if node.blend_type == "MULTIPLY" and is_color and len(inputs) == 3 else [None]


def _key(wanted: _Wanted) -> tuple[int, int]:
    socket, channels = wanted
    return socket.as_pointer(), channels


def _constant(socket: bpy.types.NodeSocket) -> MaterialValue:
    """Return the socket's own value."""
    value: Any = getattr(socket, "default_value", 0.0)
    return constant(*list(value)[:3]) if hasattr(value, "__len__") else constant(value)


def _fitting(value: MaterialValue, output: bpy.types.NodeSocket, channels: int) -> MaterialValue:
    """Convert a constant to the type of the reading socket: luminance of a colour, mean of a vector."""
    if channels == 3 or output.type not in {"RGBA", "VECTOR"}:
        return value
    grey = luminance_of(value.constant) if output.type == "RGBA" else value.constant.mean()
    return constant(float(grey))


def _fraction(value: MaterialValue) -> float:
    """Return a constant clamped to [0, 1]."""
    return min(max(value.number, 0.0), 1.0)


def _principled(reader: ShaderReader, node: bpy.types.Node) -> DiffuseSurface:
    """Return the surface of a Principled BSDF: diffuse, metallic, emissive and straight-through parts.

    The formulas are those of `closures`.
    """
    metallic = _fraction(reader.number(node, "Metallic"))
    dielectric = 1 - metallic
    weight = _fraction(reader.number(node, "Transmission Weight", "Transmission"))
    diffuse, forward = dielectric * (1 - weight), _forward(reader, node)
    albedo = reader.reflectance(node, "Base Color") * diffuse if diffuse else ZERO
    emission = reader.colour(node, "Emission Color", "Emission")
    strength = reader.number(node, "Emission Strength")
    cover, threshold = reader.alpha(node.inputs["Alpha"])
    reflect = albedo * (1 - forward) + (_metal(reader, node) * metallic if metallic else ZERO)
    passed = dielectric * weight if reader.glass else 0.0
    glass, fresnel = passed * _principled_glass(reader, node) if passed else np.zeros(3), None
    if passed:
        fresnel = Fresnel(_ior(reader, node), faces=2.0 if reader.number(node, "Thin Wall").number else 1.0)
        reflect += constant(passed * _mirror(reader, node))
    return DiffuseSurface(
        reflect=reflect,
        emit=ZERO if strength.is_zero else emission * strength,
        transmit=albedo * forward if forward else ZERO,
        through=glass,
        glass=glass,
        fresnel=fresnel,
        cover=cover,
        threshold=threshold,
    )


def _metal(reader: ShaderReader, node: bpy.types.Node) -> MaterialValue:
    """Return the albedo of a Principled or Metallic BSDF as a metal; raises ComplexError for textures."""
    if is_conductor(node):
        color = conductor_color(*(_plain(reader.colour(node, name)) for name in ("IOR", "Extinction")))
    else:
        color = np.clip(_plain(reader.colour(node, "Base Color")), 0, 1)
    return constant(*metal_albedo(color, _fraction(reader.number(node, "Roughness")), keeps_energy(node)))


def _metallic(reader: ShaderReader, node: bpy.types.Node) -> DiffuseSurface:
    return DiffuseSurface(reflect=_metal(reader, node))


def _glossy(reader: ShaderReader, node: bpy.types.Node) -> DiffuseSurface:
    color = np.clip(_plain(reader.colour(node, "Color")), 0, 1)
    roughness = _fraction(reader.number(node, "Roughness"))
    return DiffuseSurface(reflect=constant(*glossy_albedo(color, roughness, keeps_energy(node))))


def _forward(reader: ShaderReader, node: bpy.types.Node) -> float:
    """Return the fraction of the diffuse albedo that leaves a thin wall on the other side."""
    thin = reader.number(node, "Thin Wall").number
    if not thin:
        return 0.0
    weight = _fraction(reader.number(node, "Subsurface Weight", "Subsurface"))
    return thin * weight * (1 + reader.number(node, "Subsurface Anisotropy").number) / 2


def _principled_glass(reader: ShaderReader, node: bpy.types.Node) -> np.ndarray:
    """Return the straight-through transmittance for Transmission Weight 1, (3,) float64."""
    base = np.clip(_plain(reader.colour(node, "Base Color")), 0, 1)
    window, thin = _window(reader, node), reader.number(node, "Thin Wall").number
    return (1 - thin) * np.sqrt(base) * window + thin * base * window**2


def _window(reader: ShaderReader, node: bpy.types.Node) -> float:
    """Return 1 - F, the transmittance of a dielectric surface at normal incidence."""
    ior = _ior(reader, node)
    return 1 - ((ior - 1) / (ior + 1)) ** 2


def _ior(reader: ShaderReader, node: bpy.types.Node) -> float:
    return max(reader.number(node, "IOR").number, 1e-5)


def _mirror(reader: ShaderReader, node: bpy.types.Node) -> float:
    """Return F, the light that glass reflects at normal incidence; 0 below `LEAST_MIRROR`."""
    reflected = 1 - _window(reader, node)
    return reflected if reflected >= LEAST_MIRROR else 0.0


def _is_constant(value: MaterialValue) -> bool:
    return value.texture is None


def _plain(value: MaterialValue) -> np.ndarray:
    """Return a constant colour, (3,) float64; raises ComplexError for a texture."""
    if value.texture is not None:
        raise ComplexError
    return value.constant


def _diffuse(reader: ShaderReader, node: bpy.types.Node) -> DiffuseSurface:
    return DiffuseSurface(reflect=reader.reflectance(node, "Color"))


def _translucent(reader: ShaderReader, node: bpy.types.Node) -> DiffuseSurface:
    return DiffuseSurface(transmit=reader.reflectance(node, "Color"))


def _emission(reader: ShaderReader, node: bpy.types.Node) -> DiffuseSurface:
    """Return the emission of an Emission or Background shader: colour times strength."""
    return DiffuseSurface(emit=reader.colour(node, "Color") * reader.number(node, "Strength"))


def _transparent(reader: ShaderReader, node: bpy.types.Node) -> DiffuseSurface:
    return DiffuseSurface(through=_plain(reader.colour(node, "Color")))


def _refraction(reader: ShaderReader, node: bpy.types.Node) -> DiffuseSurface:
    return _transparent(reader, node) if reader.glass else BLACK


def _glass(reader: ShaderReader, node: bpy.types.Node) -> DiffuseSurface:
    if not reader.glass:
        return BLACK
    color = _plain(reader.colour(node, "Color"))
    glass = color * _window(reader, node)
    reflect = constant(*(color * _mirror(reader, node)))
    return DiffuseSurface(reflect, through=glass, glass=glass, fresnel=Fresnel(_ior(reader, node)))


def _add(reader: ShaderReader, node: bpy.types.Node) -> DiffuseSurface:
    first, second = (reader.surface(socket).solid() for socket in node.inputs[:2])
    return first + second


def _mix(reader: ShaderReader, node: bpy.types.Node) -> DiffuseSurface:
    """Return the mix of two shaders; a factor texture is possible if the first shader is a hole."""
    first, second = (reader.surface(socket) for socket in node.inputs[1:3])
    factor, threshold = reader.alpha(node.inputs[0])
    if first.is_hole and second.threshold is None:
        return replace(second, cover=second.cover * factor, threshold=threshold)
    mix = _fraction(factor) if threshold is None else float(factor.number >= threshold)
    if second.is_hole and first.threshold is None:
        return replace(first, cover=first.cover * (1 - mix))
    if mix in (0.0, 1.0):
        return second if mix else first
    return first.solid().scaled(1 - mix) + second.solid().scaled(mix)


_SHADERS = {
    PRINCIPLED: _principled,
    "ShaderNodeBsdfDiffuse": _diffuse,
    "ShaderNodeBsdfToon": _diffuse,
    "ShaderNodeSubsurfaceScattering": _diffuse,
    "ShaderNodeBsdfTranslucent": _translucent,
    **dict.fromkeys(GLOSSY, _glossy),
    METALLIC: _metallic,
    **dict.fromkeys(EMITTERS, _emission),
    "ShaderNodeBsdfTransparent": _transparent,
    GLASS: _glass,
    REFRACTION: _refraction,
    ADD: _add,
    MIX: _mix,
}


_INDEPENDENT = Dependence()


def read_material(
    material: bpy.types.Material | None,
    notes: list[str],
    cache: PixelCache,
    values: dict[Source, tuple[float, ...]] | None = None,
    depends: Dependence = _INDEPENDENT,
    glass: bool = True,
) -> Material:
    """Return the engine's material for a Blender material; an empty slot is Cycles' default grey.

    Sentences on what cannot be converted are appended to `notes`. Raises ComplexError if only Cycles can
    evaluate the material.

    values:   values of object-dependent nodes, see `object_nodes.object_values`
    depends:  whether nodes depend on the kind of ray, or on the side
    glass:    True if refracting closures transmit light without refraction
    """
    if material is None:
        return Material("(no material)", _DEFAULT_GREY, np.zeros(3, np.float32))
    tree = node_tree(material)
    if tree is None:
        colour = np.array(material.diffuse_color, np.float32)[:3]
        return Material(material.name, np.clip(colour, 0, 1), np.zeros(3, np.float32))

    def surface(rays: RayKind) -> DiffuseSurface:
        reader = ShaderReader(f"Material '{material.name}'", notes, cache, values, rays, glass)
        return _fill_clear(_output_surface(reader, tree), cache)

    front = surface(BOUNCE)
    made = to_material(
        material.name,
        Sides(
            bounce=front,
            shadow=surface(RayKind(shadow=True)) if depends.by_ray else None,
            bounce_back=surface(RayKind(back=True)) if depends.by_side else None,
            shadow_back=surface(RayKind(True, True)) if depends.by_ray and depends.by_side else None,
        ),
    )
    note_surface(material.name, front, notes)
    return made


def _fill_clear(surface: DiffuseSurface, cache: PixelCache) -> DiffuseSurface:
    """Return a surface whose textures have colours where its cover, a texture of equal mapping, is clear."""
    cover = surface.cover.texture
    factor = surface.cover.constant[0]
    if cover is None or factor <= 0:
        return surface
    least = _STEP if surface.threshold is None else surface.threshold / factor

    def filled(value: MaterialValue) -> MaterialValue:
        texture = value.texture
        if texture is None or not _are_aligned(texture, cover):
            return value
        pixels = cache.fill_clear(texture, cover.pixels, float(least))
        return replace(value, texture=replace(texture, pixels=pixels))

    reflect, emit, transmit = (filled(value) for value in (surface.reflect, surface.emit, surface.transmit))
    return replace(surface, reflect=reflect, emit=emit, transmit=transmit)


def _are_aligned(first: Texture, second: Texture) -> bool:
    """Return True if pixels of equal indices of two textures lie at the same points of a surface."""
    return (
        first.pixels.shape[:2] == second.pixels.shape[:2]
        and (first.uv_map, first.extension) == (second.uv_map, second.extension)
        and np.array_equal(first.transform, second.transform)
    )


def _output_surface(reader: ShaderReader, tree: bpy.types.NodeTree) -> DiffuseSurface:
    """Return the surface of a node tree: black if nothing is linked, a hole if only a volume is linked."""
    output = tree.get_output_node("CYCLES")
    if output is None:
        return BLACK
    if (
        not feeding_socket(output.inputs["Surface"]).is_output
        and feeding_socket(output.inputs["Volume"]).is_output
    ):
        return HOLE
    return reader.surface(output.inputs["Surface"])
