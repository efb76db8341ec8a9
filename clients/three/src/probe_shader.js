// Light of probe grids in the shaders of WebGLRenderer.

import { ShaderChunk } from 'three';

const CHUNK = '#include <lightprobes_pars_fragment>';

// three.js looks half a cell along the normal; Blender's preview looks at the point itself.
const AT_POINT = ShaderChunk.lightprobes_pars_fragment.replaceAll(/ \+ worldNormal \* \w+ \* 0\.5/g, '');

const NONE = ShaderChunk.lightprobes_pars_fragment.replace(/return all\([^;]*;/, 'return false;');

/** Lets a material look up probe grids at its points, instead of half a cell along its normals. */
export function lookUpAtPoints(material) {
  replaceLookup(material, AT_POINT, 'hemibake probes at points');
}

/** Lets a material take no light from probe grids, since its lightmap has that light. */
export function hideProbes(material) {
  replaceLookup(material, NONE, 'hemibake no probes');
}

function replaceLookup(material, lookup, name) {
  const before = material.onBeforeCompile, key = material.customProgramCacheKey();
  material.onBeforeCompile = (shader, renderer) => {
    before.call(material, shader, renderer);
    shader.fragmentShader = shader.fragmentShader
      .replace('#include <lights_pars_begin>', ShaderChunk.lights_pars_begin.replace(CHUNK, lookup));
  };
  material.customProgramCacheKey = () => `${key} ${name}`;
  material.needsUpdate = true;
}
