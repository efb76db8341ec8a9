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
    const kind = KINDS.find(({ names }) => names.every(name => maps[name]));
    if (material.normalMap && kind) shadeNormalMap(material, kind, kind.names.map(name => maps[name]));
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

// Directional maps, L0 first, and the light E(n')/π of the normal n' that a normal map makes of n: of Directional
// E(n)/π + L1 · (n' - n), of Spherical Harmonics SH L0 max(0, 1 + 2 SH L1 · n').
const KINDS = [{
  names: ['L0', 'L1 x', 'L1 y', 'L1 z'],
  light: 'max(lightMapTexel.rgb + alongL1(normal - nonPerturbedNormal), 0.0)',
}, {
  names: ['SH L0', 'SH L1 x', 'SH L1 y', 'SH L1 z'],
  light: 'texture2D(l0Map, vLightMapUv).rgb * max(1.0 + 2.0 * alongL1(normal), 0.0)',
}];

// Lets a material show the light of its normal map. The maps of L1 are of Blender's axes, whose z is up: (x, -z, y)
// of three.js.
function shadeNormalMap(material, kind, maps) {
  material.onBeforeCompile = shader => {
    ['l0Map', 'l1MapX', 'l1MapY', 'l1MapZ'].forEach((name, i) => { shader.uniforms[name] = { value: maps[i] }; });
    shader.fragmentShader = shader.fragmentShader
      .replace('#include <normalmap_pars_fragment>', EVEN_TANGENTS)
      .replace('#include <lightmap_pars_fragment>', `#include <lightmap_pars_fragment>
        uniform sampler2D l0Map, l1MapX, l1MapY, l1MapZ;
        vec3 alongL1(const in vec3 direction) {
          vec3 n = direction * mat3(viewMatrix);  // transposed: view to world
          return n.x * texture2D(l1MapX, vLightMapUv).rgb - n.z * texture2D(l1MapY, vLightMapUv).rgb
            + n.y * texture2D(l1MapZ, vLightMapUv).rgb;
        }`)
      .replace('#include <lights_fragment_maps>', `#include <lights_fragment_maps>
        irradiance += lightMapIntensity * (${kind.light} - lightMapTexel.rgb);`);
  };
  material.customProgramCacheKey = () => kind.names[0];
}
