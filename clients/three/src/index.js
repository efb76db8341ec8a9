export { HemibakeLoader } from './loader.js';
export { loadProbeGrids } from './probe_grids.js';
export { LightmappedScene } from './lightmapped_scene.js';
