export { HemibakeLoader } from './loader.js';
export { loadProbeGrids, ProbeGrids } from './probe_grids.js';
export { loadReflections, Reflections } from './reflections.js';
export { LightmappedScene } from './lightmapped_scene.js';
