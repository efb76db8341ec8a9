// Lightmaps of a glTF file that Hemibake's "Export for Engine" has written, for three.js' GLTFLoader:
//
//     const loader = new GLTFLoader();
//     loader.register(parser => new Lightmaps(parser));
//     const gltf = await loader.loadAsync('room.glb');
//
// A material with a lightmap has the extension MOZ_lightmap: { index, texCoord, intensity }. Irradiance is
// texel x intensity. three.js takes a lightmap for irradiance, and shows color / π times it; Hemibake's maps
// hold irradiance / π, so that the intensity is π. The texels are linear, in PNG, too.

import { HalfFloatType, LinearSRGBColorSpace, ShaderChunk } from 'three';
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

// Replaces the lightmaps of a loaded file by the OpenEXR files beside it, which hemibake.json lists. Normal maps
// are shaded where directional maps are among these.
export async function useFiles(gltf, file, folder) {
  const { lightmaps } = await (await fetch(`${folder}/hemibake.json`)).json();
  const textures = {};
  for (const [name, entry] of Object.entries(lightmaps)) {
    if (entry.export !== file) continue;
    const output = 'decode' in entry ? entry.output : 'light';
    (textures[entry.atlas] ??= {})[output] = await loadTexture(`${folder}/${encodeURIComponent(name)}`);
  }
  gltf.scene.traverse(({ material }) => {
    const maps = material?.lightMap && textures[material.lightMap.name];
    if (!maps) return;
    material.lightMap = maps.light;
    material.lightMapIntensity = Math.PI;
    if (material.normalMap && maps['L1 x']) shadeNormalMap(material, ['L1 x', 'L1 y', 'L1 z'].map(name => maps[name]));
  });
}

async function loadTexture(path) {
  const texture = await new EXRLoader().setDataType(HalfFloatType).loadAsync(path);
  // The loader has the bottom row first; v of glTF is 0 at the top.
  texture.flipY = true;
  texture.channel = 1;
  texture.colorSpace = LinearSRGBColorSpace;
  return texture;
}

// three.js flattens normal maps where their UVs are stretched; in Blender both tangents have length 1.
const EVEN_TANGENTS = ShaderChunk.normalmap_pars_fragment
  .replace('mat3( T * scale, B * scale, N )', 'mat3( normalize( T ), normalize( B ), N )');

// Lets a material show E(n')/π = E(n)/π + L1 · (n' - n) of the normal n' that its normal map makes of n. The three
// maps of L1 are of Blender's axes, whose z is up: (x, -z, y) of three.js.
function shadeNormalMap(material, maps) {
  material.onBeforeCompile = shader => {
    maps.forEach((map, axis) => { shader.uniforms[`l1Map${'XYZ'[axis]}`] = { value: map }; });
    shader.fragmentShader = shader.fragmentShader
      .replace('#include <normalmap_pars_fragment>', EVEN_TANGENTS)
      .replace('#include <lightmap_pars_fragment>', `#include <lightmap_pars_fragment>
        uniform sampler2D l1MapX, l1MapY, l1MapZ;`)
      .replace('#include <lights_fragment_maps>', `#include <lights_fragment_maps>
        vec3 tilt = ((normal - nonPerturbedNormal) * mat3(viewMatrix));  // transposed: view to world
        irradiance += lightMapIntensity * (tilt.x * texture2D(l1MapX, vLightMapUv).rgb
          - tilt.z * texture2D(l1MapY, vLightMapUv).rgb + tilt.y * texture2D(l1MapZ, vLightMapUv).rgb);
        irradiance = max(irradiance, 0.0);`);
  };
  material.customProgramCacheKey = () => 'l1';
}
