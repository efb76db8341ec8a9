// Loads .glb files with Hemibake's lightmaps and light states into Babylon.js.

import { Constants } from '@babylonjs/core/Engines/constants.js';
import { EffectRenderer, EffectWrapper } from '@babylonjs/core/Materials/effectRenderer.js';
import { RawTexture } from '@babylonjs/core/Materials/Textures/rawTexture.js';
import { RenderTargetTexture } from '@babylonjs/core/Materials/Textures/renderTargetTexture.js';
import { ImportMeshAsync } from '@babylonjs/core/Loading/sceneLoader.js';
import { LightControl, loadLightmaps, mixFunction, readRadiance } from 'hemibake-manifest';

export class HemibakeLoader {
  /** scene: Babylon.js scene that the file is loaded into. */
  constructor(scene) {
    this.scene = scene;
  }

  /** Returns a LightmappedScene. Rejects only if the .glb file itself cannot be read. */
  async load(url) {
    const { glb, states, problems, sources } = await loadLightmaps(url);
    const address = URL.createObjectURL(glb.plain());
    const loaded = await ImportMeshAsync(address, this.scene, { pluginExtension: '.glb' })
      .finally(() => URL.revokeObjectURL(address));
    const lightmaps = new Map(), copies = new Map(), unreadable = new Set();
    for (const mesh of loaded.meshes.filter(other => other.material !== null)) {
      const source = await sources(materialIndex(mesh.material), [mesh.name, mesh.parent?.name]);
      if (source === null) continue;
      const { name, maps } = source, key = `${mesh.material.uniqueId} ${name}`;
      if (!isReadable(maps)) {
        unreadable.add(`Lightmap '${name}': this loader reads no PNG. Export or bake with Radiance HDR.`);
        continue;
      }
      if (!lightmaps.has(name)) lightmaps.set(name, await Lightmap.create(this.scene, name, maps));
      if (!copies.has(key)) copies.set(key, lit(mesh.material, lightmaps.get(name).texture));
      mesh.material = copies.get(key);
    }
    return new LightmappedScene(loaded, [...lightmaps.values()], states, [...problems, ...unreadable]);
  }
}

export class LightmappedScene extends LightControl {
  constructor(loaded, lightmaps, states, problems) {
    super(lightmaps, states, problems);
    this.loaded = loaded;
    this.meshes = loaded.meshes;
  }
}

/** Light of one lightmap, mixed into a half-float render target. */
class Lightmap {
  static async create(scene, name, { light, groups }) {
    const maps = groups.size ? [...groups.values()] : [light];
    const textures = await Promise.all(maps.map(map => textureOf(scene, map)));
    const made = new Lightmap(scene, name, [...groups.keys()], maps, textures);
    await new Promise(resolve => made.wrapper.effect.executeWhenCompiled(resolve));
    made.mix(new Map(made.groups.map(group => [group, [1, 1, 1]])));
    return made;
  }

  constructor(scene, name, groups, maps, textures) {
    const engine = scene.getEngine(), numbers = [...maps.keys()];
    this.groups = groups;
    this.textures = textures;
    this.weights = maps.map(() => [1, 1, 1]);
    this.texture = new RenderTargetTexture(name, textures[0].getSize(), scene, {
      type: Constants.TEXTURETYPE_HALF_FLOAT, generateMipMaps: false, generateDepthBuffer: false,
      samplingMode: Constants.TEXTURE_BILINEAR_SAMPLINGMODE,
    });
    // Anisotropic samples would mix texels beyond the borders of charts.
    Object.assign(this.texture, {
      anisotropicFilteringLevel: 1, coordinatesIndex: 1, gammaSpace: false,
      wrapU: Constants.TEXTURE_CLAMP_ADDRESSMODE, wrapV: Constants.TEXTURE_CLAMP_ADDRESSMODE,
    });
    this.renderer = new EffectRenderer(engine);
    this.wrapper = new EffectWrapper({
      engine, name: 'hemibake mix', useShaderStore: false,
      fragmentShader: `precision highp float;
        varying vec2 vUV;
        ${mixFunction(maps.map(map => map.decode))}
        void main(void) { gl_FragColor = vec4(mixedLight(vUV), 1.0); }`,
      uniformNames: numbers.flatMap(i => [`weight${i}`, `intensity${i}`]),
      samplerNames: numbers.map(i => `map${i}`),
    });
    this.wrapper.onApplyObservable.add(() => {
      for (const [i, map] of maps.entries()) {
        this.wrapper.effect.setTexture(`map${i}`, textures[i]);
        this.wrapper.effect.setFloat3(`weight${i}`, ...this.weights[i]);
        this.wrapper.effect.setFloat(`intensity${i}`, map.intensity);
      }
    });
  }

  mix(factors) {
    if (this.groups.length) this.weights = this.groups.map(group => factors.get(group));
    this.renderer.render(this.wrapper, this.texture);
  }

  dispose() {
    for (const part of [this.texture, this.wrapper, this.renderer, ...this.textures]) part.dispose();
  }
}

async function textureOf(scene, { bytes }) {
  const { width, height, data } = readRadiance(bytes), nearest = Constants.TEXTURE_NEAREST_SAMPLINGMODE;
  return RawTexture.CreateRGBATexture(data, width, height, scene, false, false, nearest, Constants.TEXTURETYPE_FLOAT);
}

function isReadable({ light, groups }) {
  const maps = groups.size ? [...groups.values()] : [light];
  return maps.every(({ mime }) => mime === 'image/vnd.radiance');
}

// Index of a material in the file; undefined for the default material.
function materialIndex(material) {
  const pointer = material._internalMetadata?.gltf?.pointers?.find(path => path.startsWith('/materials/'));
  return pointer === undefined ? undefined : Number(pointer.slice('/materials/'.length));
}

// Unlit materials show albedo x lightmap + emission exactly; else Babylon.js adds the lightmap without albedo.
function lit(material, texture) {
  const made = material.clone(material.name);
  made.lightmapTexture = texture;
  made.unlit = made.useLightmapAsShadowmap = true;
  return made;
}
