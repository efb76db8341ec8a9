// Plug-in of GLTFLoader for MOZ_lightmap and MOZ_texture_rgbe, which three.js does not read.

import { HDRLoader } from 'three/addons/loaders/HDRLoader.js';

/** Decoder of textures that hold light. */
const LINEAR = 'light = intensity * rgb';

export class GltfLightmaps {
  /** inside: Map that receives { name, light, groups } by the index of each material with a lightmap. */
  constructor(parser, inside) {
    this.name = 'MOZ_lightmap';
    this.parser = parser;
    this.inside = inside;
  }

  // glTF has no textures with a high range: MOZ_texture_rgbe names an image in Radiance HDR.
  loadTexture(index) {
    const source = this.parser.json.textures[index].extensions?.MOZ_texture_rgbe?.source;
    if (source === undefined) return null;
    return this.parser.loadTextureImage(index, source, new HDRLoader(this.parser.options.manager));
  }

  async beforeRoot() {
    const materials = this.parser.json.materials ?? [];
    await Promise.all(materials.map(async (material, index) => {
      const known = material.extensions?.[this.name];
      if (known === undefined) return;
      const groups = Object.entries(known.extras?.hemibake?.groups ?? {});
      this.inside.set(index, {
        name: this.parser.json.textures[known.index].name,
        light: await this.map(known),
        groups: new Map(await Promise.all(groups.map(async ([name, group]) => [name, await this.map(group)]))),
      });
    }));
  }

  // Irradiance is texel x intensity; the maps of this package hold irradiance / pi.
  async map({ index, intensity }) {
    const texture = (await this.parser.getDependency('texture', index)).clone();
    texture.colorSpace = '';
    texture.channel = 1;
    texture.needsUpdate = true;
    return { texture, decode: LINEAR, intensity: intensity / Math.PI };
  }
}
