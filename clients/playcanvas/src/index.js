// Loads .glb files with Hemibake's lightmaps and light states into PlayCanvas.

import * as pc from 'playcanvas';
import { LightControl, loadLightmaps, mixFunction, readRadiance } from 'hemibake-manifest';

const VERTEX = `
attribute vec2 vertex_position;
varying vec2 place;
void main(void) {
  place = vertex_position * 0.5 + 0.5;
  gl_Position = vec4(vertex_position, 0.0, 1.0);
}`;

export class HemibakeLoader {
  /** app: PlayCanvas application. */
  constructor(app) {
    this.app = app;
  }

  /** Returns a LightmappedScene, whose entity is not in the scene yet. Rejects if the .glb file cannot be read. */
  async load(url) {
    const { glb, states, problems, sources } = await loadLightmaps(url);
    const materials = new Map();
    const asset = await this.#container(glb, (gltf, material) => materials.set(material, gltf.hemibakeIndex));
    const entity = asset.resource.instantiateRenderEntity(), lightmaps = new Map(), copies = new Map();
    for (const render of entity.findComponents('render')) {
      for (const instance of render.meshInstances) {
        const { node } = instance, names = [node.name, node.parent?.name];
        const source = await sources(materials.get(instance.material), names);
        if (source === null) continue;
        const { name, maps } = source, key = `${instance.material.id} ${name}`;
        if (!lightmaps.has(name)) lightmaps.set(name, await Lightmap.create(this.app.graphicsDevice, name, maps));
        if (!copies.has(key)) copies.set(key, lit(instance.material, lightmaps.get(name).texture));
        instance.material = copies.get(key);
      }
    }
    return new LightmappedScene(asset, entity, [...lightmaps.values()], states, problems);
  }

  #container(glb, postprocess) {
    glb.json.materials?.forEach((material, index) => { material.hemibakeIndex = index; });
    const address = URL.createObjectURL(glb.plain());
    const asset = new pc.Asset('lightmaps', 'container', { url: address, filename: 'room.glb' }, null, {
      material: { postprocess },
    });
    return new Promise((resolve, reject) => {
      asset.once('load', () => resolve(asset));
      asset.once('error', message => reject(new Error(message)));
      this.app.assets.add(asset);
      this.app.assets.load(asset);
    }).finally(() => URL.revokeObjectURL(address));
  }
}

export class LightmappedScene extends LightControl {
  constructor(asset, entity, lightmaps, states, problems) {
    super(lightmaps, states, problems);
    this.asset = asset;
    this.entity = entity;
  }
}

/** Light of one lightmap, mixed into a half-float render target. */
class Lightmap {
  static async create(device, name, { light, groups }) {
    const maps = groups.size ? [...groups.values()] : [light];
    const textures = await Promise.all(maps.map(map => textureOf(device, map)));
    const made = new Lightmap(device, name, [...groups.keys()], maps, textures);
    made.mix(new Map(made.groups.map(group => [group, [1, 1, 1]])));
    return made;
  }

  constructor(device, name, groups, maps, textures) {
    const { width, height } = textures[0], decodes = maps.map(map => map.decode);
    Object.assign(this, { device, groups, maps, textures });
    this.texture = new pc.Texture(device, {
      ...plain(name, width, height), format: pc.PIXELFORMAT_RGBA16F, minFilter: pc.FILTER_LINEAR, magFilter: pc.FILTER_LINEAR,
    });
    this.target = new pc.RenderTarget({ colorBuffer: this.texture, depth: false });
    this.shader = pc.ShaderUtils.createShader(device, {
      uniqueName: `hemibake mix ${JSON.stringify(decodes)}`,
      attributes: { vertex_position: pc.SEMANTIC_POSITION },
      vertexGLSL: VERTEX,
      fragmentGLSL: `
        varying vec2 place;
        ${mixFunction(decodes)}
        void main(void) { gl_FragColor = vec4(mixedLight(place), 1.0); }`,
    });
  }

  mix(factors) {
    const { scope } = this.device;
    for (const [i, map] of this.maps.entries()) {
      scope.resolve(`map${i}`).setValue(this.textures[i]);
      scope.resolve(`weight${i}`).setValue(this.groups.length ? factors.get(this.groups[i]) : [1, 1, 1]);
      scope.resolve(`intensity${i}`).setValue(map.intensity);
    }
    this.device.setBlendState(pc.BlendState.NOBLEND);
    this.device.setDepthState(pc.DepthState.NODEPTH);
    this.device.setCullMode(pc.CULLFACE_NONE);
    pc.drawQuadWithShader(this.device, this.target, this.shader);
  }

  dispose() {
    this.target.destroy();
    for (const texture of [this.texture, ...this.textures]) texture.destroy();
  }
}

async function textureOf(device, { bytes, mime }) {
  if (mime === 'image/vnd.radiance') {
    const { width, height, data } = readRadiance(bytes);
    return new pc.Texture(device, {
      ...plain('lightmap', width, height), format: pc.PIXELFORMAT_RGBA32F, levels: [data],
    });
  }
  const options = { premultiplyAlpha: 'none', colorSpaceConversion: 'none' };
  const image = await createImageBitmap(new Blob([bytes], { type: mime }), options);
  const texture = new pc.Texture(device, {
    ...plain('lightmap', image.width, image.height), format: pc.PIXELFORMAT_RGBA8,
  });
  texture.setSource(image);
  return texture;
}

function plain(name, width, height) {
  return {
    name, width, height, mipmaps: false, minFilter: pc.FILTER_NEAREST, magFilter: pc.FILTER_NEAREST,
    addressU: pc.ADDRESS_CLAMP_TO_EDGE, addressV: pc.ADDRESS_CLAMP_TO_EDGE, flipY: false,
  };
}

function lit(material, texture) {
  const made = material.clone();
  Object.assign(made, { lightMap: texture, lightMapUv: 1, useSkybox: false, useLighting: true });
  made.update();
  return made;
}
