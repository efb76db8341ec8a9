// Light of one lightmap: a map of all light, or maps of light groups that are mixed into a half-float target.

import {
  Color, CustomBlending, GLSL3, HalfFloatType, LinearFilter, LinearMipmapLinearFilter, Mesh, NearestFilter,
  NearestMipmapNearestFilter, OneFactor, OrthographicCamera, PlaneGeometry, RawShaderMaterial, Scene, Vector3,
  WebGLRenderTarget,
} from 'three';
import { decodeFunction } from 'hemibake-manifest';

const VERTEX = `
in vec3 position;
out vec2 place;
void main() {
  place = position.xy * 0.5 + 0.5;
  gl_Position = vec4(position.xy, 0.0, 1.0);
}`;

const FRAGMENT = decode => `
precision highp float;
uniform sampler2D map;
uniform vec3 weight;
uniform float intensity;
uniform float level;
in vec2 place;
out vec4 result;
${decodeFunction(decode)}
void main() {
  result = vec4(weight * decodedLight(textureLod(map, place, level), intensity), 1.0);
}`;

export class Lightmap {
  #renderer; #light; #groups; #target; #all = null;

  /**
   * light:        map of all light, { texture, levels, decode, intensity }; null without one. levels is the number
   *               of mip levels in its file, 1 if absent: those of KTX2 mix no charts
   * groups:       Map of the maps of light groups
   * directional:  Map of directional maps, decoded to textures
   */
  constructor(renderer, name, light, groups, directional) {
    this.name = name;
    this.#renderer = renderer;
    this.#light = light;
    this.#groups = groups;
    this.#target = this.#decoded(groups.size ? [...groups.values()] : [light]);
    if (light !== null && groups.size) this.#all = this.#decoded([light]);
    this.directional = new Map([...directional].map(([output, map]) => [output, this.#decoded([map]).texture]));
  }

  get groups() { return [...this.#groups.keys()]; }

  /** Texture of the present light, E / pi. */
  get texture() { return this.#target.texture; }

  /** Texture of all light, which equals the present light without light groups. */
  get all() { return (this.#all ?? this.#target).texture; }

  /** Mixes the light groups by their factors, a Map of RGB by group. */
  mix(factors) {
    if (this.#groups.size === 0) return;
    this.#draw(this.#target, [...this.#groups].map(([name, map]) => [map, factors.get(name)]));
  }

  dispose() {
    this.#target.dispose();
    this.#all?.dispose();
    for (const map of [this.#light, ...this.#groups.values()]) map?.texture.dispose();
  }

  #decoded(maps) {
    const { width, height } = maps[0].texture.image, levels = Math.min(...maps.map(map => map.levels ?? 1));
    const target = new WebGLRenderTarget(width, height, {
      type: HalfFloatType, minFilter: levels > 1 ? LinearMipmapLinearFilter : LinearFilter, magFilter: LinearFilter,
      depthBuffer: false, generateMipmaps: false,
    });
    if (levels > 1) {
      const sizes = Array.from({ length: levels }, (_, level) => [width, height].map(size => Math.max(1, size >> level)));
      target.texture.mipmaps = sizes.map(([width, height]) => ({ width, height }));
    }
    target.texture.channel = 1;
    target.texture.name = this.name;
    this.#draw(target, maps.map(map => [map, [1, 1, 1]]));
    return target;
  }

  // Adds weighted maps texel by texel, so that encoded texels are decoded before they are filtered.
  #draw(target, weighted) {
    const renderer = this.#renderer, before = renderer.getRenderTarget();
    const { autoClear, xr: { enabled } } = renderer, alpha = renderer.getClearAlpha();
    const color = renderer.getClearColor(new Color());
    renderer.xr.enabled = renderer.autoClear = false;
    renderer.setClearColor(0x000000, 0);
    for (let level = 0; level < Math.max(1, target.texture.mipmaps.length); level++) {
      target.viewport.set(0, 0, Math.max(1, target.width >> level), Math.max(1, target.height >> level));
      renderer.setRenderTarget(target, 0, level);
      renderer.clear(true, false, false);
      for (const [map, weight] of weighted) drawMap(renderer, map, weight, level);
    }
    renderer.setClearColor(color, alpha);
    renderer.setRenderTarget(before);
    renderer.autoClear = autoClear;
    renderer.xr.enabled = enabled;
  }
}

const scenes = new Map(), camera = new OrthographicCamera(-1, 1, 1, -1, 0, 1);

function drawMap(renderer, map, weight, level) {
  const { scene, uniforms } = sceneFor(map.decode), { minFilter, magFilter } = map.texture;
  map.texture.minFilter = map.levels > 1 ? NearestMipmapNearestFilter : NearestFilter;
  map.texture.magFilter = NearestFilter;
  uniforms.level.value = level;
  uniforms.map.value = map.texture;
  uniforms.weight.value.set(...weight);
  uniforms.intensity.value = map.intensity;
  renderer.render(scene, camera);
  Object.assign(map.texture, { minFilter, magFilter });
}

// A scene for each decoder, since each is a program of its own.
function sceneFor(decode) {
  if (!scenes.has(decode)) {
    const uniforms = {
      map: { value: null }, weight: { value: new Vector3() }, intensity: { value: 1 }, level: { value: 0 },
    };
    const material = new RawShaderMaterial({
      uniforms, glslVersion: GLSL3, vertexShader: VERTEX, fragmentShader: FRAGMENT(decode), depthTest: false,
      depthWrite: false, blending: CustomBlending, blendSrc: OneFactor, blendDst: OneFactor,
    });
    const quad = new Mesh(new PlaneGeometry(2, 2), material), scene = new Scene();
    quad.frustumCulled = false;
    scene.add(quad);
    scenes.set(decode, { scene, uniforms });
  }
  return scenes.get(decode);
}
