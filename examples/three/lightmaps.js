// Lightmaps of a glTF file that Hemibake's "Export for Engine" has written, for three.js' GLTFLoader:
//
//     const loader = new GLTFLoader();
//     loader.register(parser => new Lightmaps(parser));
//     const gltf = await loader.loadAsync('room.glb');
//
// A material with a lightmap has the extension MOZ_lightmap: { index, texCoord, intensity }. Irradiance is
// texel x intensity. three.js takes a lightmap for irradiance, and shows color / π times it; Hemibake's maps
// hold irradiance / π, so that the intensity is π. The texels are linear, in PNG, too.

import { LinearSRGBColorSpace, HalfFloatType } from 'three';
import { EXRLoader } from 'three/addons/loaders/EXRLoader.js';
import { HDRLoader } from 'three/addons/loaders/HDRLoader.js';

export class Lightmaps {
  constructor(parser) {
    this.name = 'MOZ_lightmap';
    this.parser = parser;
  }

  // glTF itself has no textures with a high range: MOZ_texture_rgbe names an image in Radiance HDR.
  loadTexture(index) {
    const source = this.parser.json.textures[index].extensions?.MOZ_texture_rgbe?.source;
    if (source === undefined) return null;
    return this.parser.loadTextureImage(index, source, new HDRLoader(this.parser.options.manager));
  }

  async extendMaterialParams(index, parameters) {
    const lightmap = this.parser.json.materials[index].extensions?.[this.name];
    if (lightmap === undefined) return;
    await this.parser.assignTexture(parameters, 'lightMap', lightmap);
    parameters.lightMapIntensity = lightmap.intensity;
  }
}

// Replaces the lightmaps of a loaded file by the OpenEXR files beside it, which hemibake.json lists.
export async function useFiles(gltf, file, folder) {
  const { lightmaps } = await (await fetch(`${folder}/hemibake.json`)).json();
  const loader = new EXRLoader().setDataType(HalfFloatType);
  const textures = {};
  for (const [name, entry] of Object.entries(lightmaps)) {
    if (entry.export !== file) continue;
    const texture = await loader.loadAsync(`${folder}/${encodeURIComponent(name)}`);
    // The loader has the bottom row first; v of glTF is 0 at the top.
    texture.flipY = true;
    texture.channel = 1;
    texture.colorSpace = LinearSRGBColorSpace;
    textures[entry.atlas] = texture;
  }
  gltf.scene.traverse(({ material }) => {
    if (material?.lightMap && textures[material.lightMap.name]) {
      material.lightMap = textures[material.lightMap.name];
      material.lightMapIntensity = Math.PI;
    }
  });
}
