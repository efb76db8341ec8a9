// The manifest hemibake.json, version 2, and the same keys in the extras of a .glb file.

/** Version of the manifest that this package reads. */
export const VERSION = 2;

const GROUP = 'light_group ';

/** Formats whose loaders return light; texels of all others are decoded by the formula of the manifest. */
const LINEAR = ['exr', 'hdr', 'ktx2'];

/** Outputs that are shown as the light of a surface, the first one that exists. */
const SHOWN = ['combined', 'direct', 'indirect', 'ambient_occlusion'];

/**
 * Checks a parsed manifest. Returns { manifest, problems }; the manifest is empty if its version is unknown.
 */
export function readManifest(json, name = 'hemibake.json') {
  const empty = { version: VERSION, lightmaps: {}, objects: [], groups: [], states: {}, probes: [], reflections: [] };
  if (json === null || typeof json !== 'object' || typeof json.lightmaps !== 'object') {
    return { manifest: empty, problems: [`${name}: no manifest of lightmaps. Export again.`] };
  }
  const problem = versionProblem(json.version, name);
  return problem ? { manifest: empty, problems: [problem] } : { manifest: { ...empty, ...json }, problems: [] };
}

/**
 * Reads the extras of a glTF asset. Returns { groups, states, problems }; without extras both are empty.
 */
export function readExtras(extras, name) {
  const known = extras?.hemibake;
  if (!known) return { groups: [], states: {}, problems: [] };
  const problem = versionProblem(known.version, name);
  if (problem) return { groups: [], states: {}, problems: [problem] };
  return { groups: known.groups ?? [], states: known.states ?? {}, problems: [] };
}

/**
 * Lists the maps of a glTF file: those that its export wrote, else those of a bake.
 *
 * Returns { atlases, atlasOf }. atlases: Map of { light, groups, directional } by atlas, each map { file, entry };
 * groups and directional are Maps by group and output. atlasOf: Map of atlases by the name of an object; an object
 * with instances in several atlases is left out. An atlas that several scenes have baked has the maps of the scene
 * that was written last.
 */
export function lightmapsOf(manifest, file) {
  const all = Object.entries(manifest.lightmaps)
    .filter(([, entry]) => entry.output !== undefined && entry.shown_for === undefined);
  const exported = all.filter(([, entry]) => entry.export === file);
  const chosen = ofLastScenes(exported.length ? exported : all.filter(([, entry]) => entry.export === undefined));
  const atlases = new Map(), atlasOf = new Map();
  for (const [name, entry] of chosen) {
    if (!atlases.has(entry.atlas)) {
      atlases.set(entry.atlas, { light: null, groups: new Map(), directional: new Map() });
    }
    place(atlases.get(entry.atlas), { file: name, entry });
    for (const { object } of entry.objects) {
      const other = atlasOf.get(object);
      atlasOf.set(object, other === undefined || other === entry.atlas ? entry.atlas : null);
    }
  }
  for (const [object, atlas] of atlasOf) if (atlas === null) atlasOf.delete(object);
  return { atlases, atlasOf };
}

/** Returns true if a map holds light as its file stores it, so that no shader has to decode it. */
export function hasLight(entry) {
  return LINEAR.includes(entry.format);
}

/** Returns GLSL statements that set `vec3 light` from `vec3 rgb`, `float a` and `float intensity`. */
export function decoder(entry) {
  return hasLight(entry) ? 'light = rgb' : entry.decode_texel;
}

// Leaves out maps of an atlas of other scenes than the last one; later files are written later.
function ofLastScenes(entries) {
  const last = new Map(entries.filter(([, { scene }]) => scene).map(([, { atlas, scene }]) => [atlas, scene]));
  return entries.filter(([, { atlas, scene }]) => (scene ?? last.get(atlas)) === last.get(atlas));
}

function place(atlas, map) {
  const { output, decode } = map.entry;
  if (output.startsWith(GROUP)) atlas.groups.set(output.slice(GROUP.length), map);
  else if (decode !== undefined) atlas.directional.set(output, map);
  else if (SHOWN.includes(output) && rank(map) < rank(atlas.light)) atlas.light = map;
}

function rank(map) {
  return map === null ? SHOWN.length : SHOWN.indexOf(map.entry.output);
}

function versionProblem(version, name) {
  return version === VERSION
    ? ''
    : `${name}: version ${version} is unknown. Export with a Hemibake that writes version ${VERSION}, or update the loader.`;
}
