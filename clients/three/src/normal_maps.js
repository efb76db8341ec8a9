// Light of normal maps by directional maps.

import { ShaderChunk } from 'three';

// three.js flattens normal maps where their UVs are stretched; in Blender both tangents have length 1.
const EVEN_TANGENTS = ShaderChunk.normalmap_pars_fragment
  .replace('mat3( T * scale, B * scale, N )', 'mat3( normalize( T ), normalize( B ), N )');

/**
 * Directional maps, L0 first, and the light E(n') / pi of the normal n' that a normal map makes of n: of Directional
 * E(n) / pi + L1 . (n' - n), of Spherical Harmonics SH L0 max(0, 1 + 2 SH L1 . n'). A mix of light groups scales L0 and
 * L1 by the ratio of mixed to all light, as Blender's preview does.
 */
export const DIRECTIONAL = [{
  names: ['L0', 'L1 x', 'L1 y', 'L1 z'],
  light: 'max(lightMapTexel.rgb + mixRatio(lightMapTexel.rgb) * alongL1(normal - nonPerturbedNormal), 0.0)',
}, {
  names: ['SH L0', 'SH L1 x', 'SH L1 y', 'SH L1 z'],
  light: 'mixRatio(lightMapTexel.rgb) * texture2D(l0Map, vLightMapUv).rgb * max(1.0 + 2.0 * alongL1(normal), 0.0)',
}];

/** Lets a material show the light of its normal map. The maps of L1 have Blender's axes: (x, -z, y) of three.js. */
export function shadeNormalMap(material, kind, lightmap) {
  const textures = [...kind.names.map(name => lightmap.directional.get(name)), lightmap.all];
  material.onBeforeCompile = shader => {
    ['l0Map', 'l1MapX', 'l1MapY', 'l1MapZ', 'allMap'].forEach((name, i) => {
      shader.uniforms[name] = { value: textures[i] };
    });
    shader.fragmentShader = shader.fragmentShader
      .replace('#include <normalmap_pars_fragment>', EVEN_TANGENTS)
      .replace('#include <lightmap_pars_fragment>', `#include <lightmap_pars_fragment>
        uniform sampler2D l0Map, l1MapX, l1MapY, l1MapZ, allMap;
        vec3 alongL1(const in vec3 direction) {
          vec3 n = direction * mat3(viewMatrix);  // transposed: view to world
          return n.x * texture2D(l1MapX, vLightMapUv).rgb - n.z * texture2D(l1MapY, vLightMapUv).rgb
            + n.y * texture2D(l1MapZ, vLightMapUv).rgb;
        }
        vec3 mixRatio(const in vec3 light) {
          vec3 all = texture2D(allMap, vLightMapUv).rgb;
          return mix(vec3(0.0), light / max(all, vec3(1e-20)), greaterThan(all, vec3(0.0)));
        }`)
      .replace('#include <lights_fragment_maps>', `#include <lights_fragment_maps>
        irradiance += lightMapIntensity * (${kind.light} - lightMapTexel.rgb);`);
  };
  material.customProgramCacheKey = () => `hemibake ${kind.names[0]}`;
}
