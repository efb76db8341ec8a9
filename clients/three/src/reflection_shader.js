// Standard materials that reflect a prefiltered cube map, with box projection.

const DECLARATIONS = /* glsl */`
uniform samplerCube hemibakeCube;
uniform float hemibakeLastLevel;
uniform vec3 hemibakePosition;
uniform mat4 hemibakeToLocal;
uniform bool hemibakeIsBox;

// Distance along a ray, in lengths of the direction, at which it leaves the parallax volume; 0 outside.
float hemibakeDistance(vec3 at, vec3 direction) {
  vec3 p = (hemibakeToLocal * vec4(at, 1.0)).xyz, d = mat3(hemibakeToLocal) * direction;
  if (hemibakeIsBox) {
    if (any(greaterThan(abs(p), vec3(1.001)))) return 0.0;
    vec3 t = max((-1.0 - p) / d, (1.0 - p) / d);
    return max(min(min(t.x, t.y), t.z), 0.0);
  }
  float a = dot(d, d), b = dot(p, d), c = dot(p, p) - 1.0;
  return c > 0.002 ? 0.0 : max((sqrt(max(b * b - a * c, 0.0)) - b) / a, 0.0);
}

// Radiance of the lobe around the mirror direction. The lookup has axes x, y, -z of the world.
vec3 hemibakeRadiance(vec3 viewDir, vec3 normal, float roughness, vec3 viewPosition) {
  mat3 toWorld = transpose(mat3(viewMatrix));
  vec3 direction = normalize(mix(reflect(-viewDir, normal), normal, roughness * roughness * roughness * roughness));
  direction = toWorld * direction;
  vec3 at = toWorld * (viewPosition - viewMatrix[3].xyz);
  float far = hemibakeDistance(at, direction);
  vec3 way = far > 0.0 ? at + far * direction - hemibakePosition : direction;
  return textureLod(hemibakeCube, vec3(way.xy, -way.z), roughness * hemibakeLastLevel).rgb;
}
`;

const REFLECTION = /* glsl */`
#include <lights_fragment_maps>
#ifdef RE_IndirectSpecular
  radiance = hemibakeRadiance(geometryViewDir, geometryNormal, material.roughness, -vViewPosition);
  #ifdef USE_CLEARCOAT
    clearcoatRadiance =
      hemibakeRadiance(geometryViewDir, geometryClearcoatNormal, material.clearcoatRoughness, -vViewPosition);
  #endif
#endif
`;

/**
 * Returns a clone of a MeshStandardMaterial that reflects a cube. The cube takes the place of the specular part of other
 * environments; it adds no diffuse light, which lightmaps and probes bring.
 */
export function showReflection(material, { texture, levels, position, parallax }) {
  const made = material.clone(), compile = material.onBeforeCompile, key = material.customProgramCacheKey;
  made.userData = { ...material.userData, hemibakeOriginal: material };
  made.onBeforeCompile = function (shader, renderer) {
    compile.call(this, shader, renderer);
    Object.assign(shader.uniforms, {
      hemibakeCube: { value: texture },
      hemibakeLastLevel: { value: levels - 1 },
      hemibakePosition: { value: position },
      hemibakeToLocal: { value: parallax.toLocal },
      hemibakeIsBox: { value: parallax.shape === 'box' },
    });
    shader.fragmentShader = shader.fragmentShader
      .replace('void main() {', `${DECLARATIONS}\nvoid main() {`)
      .replace('#include <lights_fragment_maps>', REFLECTION);
  };
  made.customProgramCacheKey = () => `hemibake reflection ${key.call(material)}`;
  return made;
}
