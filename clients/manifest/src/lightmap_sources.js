// Maps of the lightmaps of a .glb file, inside it or beside it, for engines with one texture per map.

import { Glb } from './glb.js';
import { readBeside, readMap } from './beside.js';
import { readExtras } from './manifest.js';

/**
 * Loads a .glb file and what the manifest beside it lists.
 *
 * Returns { glb, states, problems, sources }. `sources(material, names)` returns { name, maps } of a
 * surface by the index of its material and the names of its node, or null; maps is { light, groups } of MapBytes.
 */
export async function loadLightmaps(url) {
  const path = url.replace(/[?#].*/, '');
  const base = path.slice(0, path.lastIndexOf('/') + 1), file = decodeURIComponent(path.slice(base.length));
  const answer = await fetch(url);
  if (!answer.ok) throw new Error(`'${file}': not readable (status ${answer.status}).`);
  const glb = new Glb(await answer.arrayBuffer()), inside = glb.lightmaps();
  const extras = readExtras(glb.json.asset.extras, file);
  const beside = await readBeside(base, file, inside.size > 0);
  const problems = [...extras.problems, ...beside.problems], read = new Map();
  const states = Object.keys(extras.states).length ? extras.states : beside.states;

  async function sources(material, names) {
    if (inside.has(material)) return { name: inside.get(material).name, maps: inside.get(material) };
    const atlas = names.map(name => beside.atlasOf.get(name)).find(known => known !== undefined);
    if (atlas === undefined) return null;
    if (!read.has(atlas)) read.set(atlas, readAtlas(base, beside.atlases.get(atlas), problems));
    const maps = await read.get(atlas);
    return maps.light === null && maps.groups.size === 0 ? null : { name: atlas, maps };
  }
  return { glb, states, problems, sources };
}

async function readAtlas(base, atlas, problems) {
  const load = async map => {
    try {
      return await readMap(base, map);
    } catch (error) {
      problems.push(`${map.file}: not readable (${error.message}). Put it beside the glTF file, or export with lightmaps inside.`);
      return null;
    }
  };
  const groups = await Promise.all([...atlas.groups].map(async ([name, map]) => [name, await load(map)]));
  return {
    light: atlas.light && await load(atlas.light),
    groups: new Map(groups.filter(([, map]) => map !== null)),
  };
}
