export { MANIFEST, fileUrl, readBeside, readMap } from './beside.js';
export { Glb } from './glb.js';
export { LightControl } from './light_control.js';
export { loadLightmaps } from './lightmap_sources.js';
export { LightMix } from './light_mix.js';
export { VERSION, decoder, hasLight, lightmapsOf, readExtras, readManifest } from './manifest.js';
export { readRadiance } from './radiance.js';
export { decodeFunction, mixFunction } from './shader.js';
