// Light probe volumes of hemibake.json as grids of three.js.

import { FloatType, LoaderUtils } from 'three';
import { EXRLoader } from 'three/addons/loaders/EXRLoader.js';
import { LightProbeGridWebGL } from 'three/addons/lighting/LightProbeGridWebGL.js';
import { LightControl, fileUrl, readManifest } from 'hemibake-manifest';
import { ProbeLight } from './probe_light.js';
import { lookUpAtPoints } from './probe_shader.js';

/** Blocks of the OpenEXR file: 9 coefficients and the validity. */
const COEFFICIENTS = 9, BLOCKS = 10;

/** Layout and coefficients that this file reads. */
const KIND = 'radiance SH L2';

/** Materials that look up grids at their points. Clones of them do not. */
const LOOKING = new WeakSet();

/**
 * Loads the probe volumes of the manifest at a URL as ProbeGrids. Rejects if the manifest cannot be read.
 *
 * Grid: class of the grids; LightProbeGrid of three/addons for WebGPURenderer
 */
export async function loadProbeGrids(url, { Grid = LightProbeGridWebGL } = {}) {
  const answer = await fetch(url), base = LoaderUtils.extractUrlBase(url);
  if (!answer.ok) throw new Error(`'${url}': not readable (status ${answer.status}).`);
  const { manifest, problems } = readManifest(await answer.json(), url), loaded = [];
  for (const volume of manifest.probes) {
    try {
      loaded.push(await loadGrid(base, volume, Grid));
    } catch (error) {
      problems.push(`Probe volume '${volume.name}': ${error.message ?? error}`);
    }
  }
  return new ProbeGrids(loaded, manifest, problems);
}

/** Grids to add to a scene, whose light changes between states. They light all materials without lightmaps. */
export class ProbeGrids extends LightControl {
  #lights;

  constructor(loaded, { states, groups }, problems) {
    super(loaded.map(({ light }) => light), states, problems, groups.map(({ name }) => name));
    this.#lights = loaded.map(({ light }) => light);
    this.grids = loaded.map(({ grid }) => grid);
  }

  /** Mixes the light groups by their factors, a Map of RGB by group. */
  mix(factors) {
    for (const light of this.#lights) light.mix(factors);
  }

  /**
   * Lets materials below an object look up the grids at their points, as Blender's preview does. three.js looks half a
   * cell along the normal, which shifts light on objects that are smaller than a cell. For WebGLRenderer.
   */
  apply(root) {
    root.traverse(({ isMesh, material }) => {
      for (const each of isMesh ? [material].flat() : []) {
        if (each.lightMap || LOOKING.has(each)) continue;
        LOOKING.add(each);
        lookUpAtPoints(each);
      }
    });
  }

  dispose() {
    super.dispose();
    for (const grid of this.grids) grid.dispose();
  }
}

async function loadGrid(base, { file, resolution: [nx, ny, nz], matrix, coefficients, name, groups = [] }, Grid) {
  if (coefficients !== KIND) throw new Error(`coefficients '${coefficients}' are unknown. Update hemibake-three.`);
  if (matrix.slice(0, 3).some((row, i) => row.slice(0, 3).some((value, j) => i !== j && Math.abs(value) > 1e-6))) {
    throw new Error('three.js shows no rotated grids. Clear the rotation of the volume in Blender.');
  }
  // (x, y, z) of Blender is (x, -z, y) of three.js.
  const [sx, sy, sz] = [0, 1, 2].map(axis => matrix[axis][axis]), resolution = [nx, nz, ny];
  const flips = [sx < 0, sz < 0, sy > 0];
  const read = async path => numbers(await readAtlas(base, path, [nx, ny, nz]), resolution, flips);
  const parts = await Promise.all(groups.map(async group => [group.name, await read(group.file)]));
  const light = new ProbeLight(resolution, await read(file), new Map(parts));
  const grid = new Grid(2 * Math.abs(sx), 2 * Math.abs(sz), 2 * Math.abs(sy), ...resolution);
  grid.name = name;
  grid.position.set(matrix[0][3], matrix[2][3], -matrix[1][3]);
  grid.updateBoundingBox();
  grid.texture = light.texture;
  if (Grid === LightProbeGridWebGL) passIntensity(grid, light);
  return { grid, light };
}

// WebGLRenderer ignores the intensity of grids; the texture contains it instead.
function passIntensity(grid, light) {
  Object.defineProperty(grid, 'intensity', {
    get: () => light.intensity, set: intensity => { light.intensity = intensity; },
  });
}

async function readAtlas(base, file, [nx, ny, nz]) {
  const { image } = await new EXRLoader().setDataType(FloatType).loadAsync(base + fileUrl(file))
    .catch(() => { throw new Error(`'${file}' is not readable. Put it beside the manifest, or bake again.`); });
  if (image.width !== BLOCKS * nx || image.height !== ny * nz) {
    throw new Error(`'${file}' has ${image.width} x ${image.height} pixels instead of ${BLOCKS * nx} x ${ny * nz}. Bake again.`);
  }
  return image;
}

// Returns 27 numbers a probe, in the axes of three.js. flips: true for axes that run against those of the file.
function numbers(image, [nx, ny, nz], flips) {
  const made = new Float32Array(27 * nx * ny * nz), flipped = (index, count, axis) => (flips[axis] ? count - 1 - index : index);
  for (let z = 0; z < nz; z++) for (let y = 0; y < ny; y++) for (let x = 0; x < nx; x++) {
    const i = flipped(x, nx, 0), k = flipped(y, ny, 1), j = flipped(z, nz, 2), row = (k * nz + j) * image.width;
    const probe = turned(Array.from({ length: COEFFICIENTS }, (_, block) => {
      const at = 4 * (row + block * nx + i);
      return [...image.data.subarray(at, at + 3)];
    }));
    made.set(probe.flat(), 27 * ((z * ny + y) * nx + x));
  }
  return made;
}

/** Returns RGB coefficients for axes with y up, (x, z, -y) of Blender's. */
function turned(c) {
  const sum = (...terms) => [0, 1, 2].map(i => terms.reduce((total, [factor, k]) => total + factor * c[k][i], 0));
  const half = Math.sqrt(3) / 2;
  return [
    c[0], c[2], sum([-1, 1]), c[3], c[7], sum([-1, 5]), sum([-0.5, 6], [-half, 8]), sum([-1, 4]),
    sum([-half, 6], [0.5, 8]),
  ];
}
