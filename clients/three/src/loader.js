// Loads a .glb or .gltf file and its lightmaps, inside the file or beside it.

import { LoaderUtils } from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { readBeside, readExtras } from 'hemibake-manifest';
import { GltfLightmaps } from './gltf_lightmaps.js';
import { LightmappedScene } from './lightmapped_scene.js';
import { Lightmap } from './lightmap.js';
import { MapFiles } from './map_files.js';
import { DIRECTIONAL, shadeNormalMap } from './normal_maps.js';
import { hideProbes } from './probe_shader.js';

export class HemibakeLoader {
  /**
   * renderer:  WebGLRenderer that mixes the light
   * maps:      'inside' prefers the lightmaps in the file, 'beside' those of hemibake.json
   */
  constructor(renderer, { maps = 'inside', manager } = {}) {
    this.renderer = renderer;
    this.maps = maps;
    this.manager = manager;
  }

  /** Returns a LightmappedScene. Throws only if the glTF file itself cannot be read. */
  async load(url) {
    const loader = new GLTFLoader(this.manager), inside = new Map();
    loader.register(parser => new GltfLightmaps(parser, inside));
    const gltf = await loader.loadAsync(url);
    const base = LoaderUtils.extractUrlBase(url);
    const file = decodeURIComponent(url.slice(base === './' ? 0 : base.length).replace(/[?#].*/, ''));
    const extras = readExtras(gltf.parser.json.asset.extras, file);
    const beside = await readBeside(base, file, inside.size > 0);
    const states = Object.keys(extras.states).length ? extras.states : beside.states;
    const problems = [...extras.problems, ...beside.problems];
    const lightmaps = await this.#assign(gltf, inside, beside, new MapFiles(this.renderer, base, problems));
    return new LightmappedScene(gltf, lightmaps, states, problems);
  }

  // Gives each material of a surface its lightmap; surfaces with one material and several lightmaps get copies.
  async #assign(gltf, inside, beside, files) {
    const lightmaps = new Map(), copies = new Map(), surfaces = [];
    gltf.scene.traverse(object => { if (object.isMesh) surfaces.push(object); });
    for (const mesh of surfaces) {
      const embedded = inside.get(gltf.parser.associations.get(mesh.material)?.materials);
      const atlas = embedded && beside.atlases.has(embedded.name) ? embedded.name : atlasOf(mesh, beside.atlasOf);
      const name = embedded?.name ?? atlas;
      if (name === undefined) continue;
      if (!lightmaps.has(name)) {
        const known = atlas === undefined ? null : beside.atlases.get(atlas);
        lightmaps.set(name, await this.#lightmap(name, embedded, known, files));
      }
      const lightmap = lightmaps.get(name);
      if (lightmap === null) continue;
      const key = `${mesh.material.uuid} ${name}`;
      if (!copies.has(key)) copies.set(key, lit(mesh.material, lightmap));
      mesh.material = copies.get(key);
    }
    return [...lightmaps.values()].filter(lightmap => lightmap !== null);
  }

  async #lightmap(name, embedded, beside, files) {
    const fromFiles = beside !== null && (this.maps === 'beside' || !embedded);
    const directional = await loadAll(files, beside?.directional ?? []);
    let light = null, groups = new Map();
    if (fromFiles) {
      light = beside.light && await files.load(beside.light);
      groups = await loadAll(files, beside.groups);
    }
    if (light === null && groups.size === 0 && embedded) ({ light, groups } = embedded);
    return light === null && groups.size === 0 ? null : new Lightmap(this.renderer, name, light, groups, directional);
  }
}

// Returns the readable ones of a Map of maps.
async function loadAll(files, maps) {
  const loaded = await Promise.all([...maps].map(async ([name, map]) => [name, await files.load(map)]));
  return new Map(loaded.filter(([, map]) => map !== null));
}

// GLTFLoader replaces characters of names, and splits a mesh with several materials into children of its node.
function atlasOf(mesh, atlases) {
  for (const object of [mesh, mesh.parent]) {
    const atlas = atlases.get(object?.userData.name ?? object?.name);
    if (atlas !== undefined) return atlas;
  }
  return undefined;
}

function lit(material, lightmap) {
  const made = material.clone();
  made.lightMap = lightmap.texture;
  // three.js shows color / pi x lightmap; the maps hold irradiance / pi.
  made.lightMapIntensity = Math.PI;
  const kind = DIRECTIONAL.find(({ names }) => names.every(name => lightmap.directional.has(name)));
  if (made.normalMap && kind) shadeNormalMap(made, kind, lightmap);
  hideProbes(made);
  return made;
}
