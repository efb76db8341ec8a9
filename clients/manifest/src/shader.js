// GLSL that decodes and mixes maps, for GLSL ES 3.00.

/** Returns the function `vec3 NAME(vec4 texel, float intensity)` for a decoder of the manifest. */
export const decodeFunction = (decode, name = 'decodedLight') => `
vec3 ${name}(vec4 texel, float intensity) {
  vec3 rgb = texel.rgb, light;
  float a = texel.a;
  ${decode};
  return light;
}`;

/**
 * Returns the function `vec3 mixedLight(vec2 place)`: the sum of weight x light of maps with these decoders.
 *
 * Its uniforms are map0, weight0 and intensity0 for the first map, and so on.
 */
export function mixFunction(decodes) {
  const each = decodes.map((decode, i) => `
uniform sampler2D map${i};
uniform vec3 weight${i};
uniform float intensity${i};
${decodeFunction(decode, `decoded${i}`)}`);
  const terms = decodes.map((_, i) => `weight${i} * decoded${i}(texture(map${i}, place), intensity${i})`);
  return `${each.join('')}
vec3 mixedLight(vec2 place) {
  return ${terms.join(' + ')};
}`;
}
