export { HemibakeLoader } from './loader.js';
export { LightmappedScene } from './lightmapped_scene.js';
