// Light probe volumes of hemibake.json as grids of three.js.

import { Data3DTexture, DataUtils, FloatType, HalfFloatType, LinearFilter, LoaderUtils, RGBAFormat } from 'three';
import { EXRLoader } from 'three/addons/loaders/EXRLoader.js';
import { LightProbeGridWebGL } from 'three/addons/lighting/LightProbeGridWebGL.js';
import { readManifest } from 'hemibake-manifest';

/** Blocks of the OpenEXR file: 9 coefficients and the validity. */
const COEFFICIENTS = 9, BLOCKS = 10;

/** Layout and coefficients that this file reads. */
const KIND = 'radiance SH L2';

/**
 * Returns { grids, problems } of the manifest at a URL. Each grid is a LightProbeGridWebGL to add to a scene; it lights
 * all materials inside, also those with lightmaps.
 */
export async function loadProbeGrids(url) {
  const answer = await fetch(url), base = LoaderUtils.extractUrlBase(url);
  if (!answer.ok) throw new Error(`'${url}': not readable (status ${answer.status}).`);
  const { manifest, problems } = readManifest(await answer.json(), url), grids = [];
  for (const volume of manifest.probes) {
    try {
      grids.push(await loadGrid(base, volume));
    } catch (error) {
      problems.push(`Probe volume '${volume.name}': ${error.message ?? error}`);
    }
  }
  for (const problem of problems) console.warn(problem);
  return { grids, problems };
}

async function loadGrid(base, { file, resolution: [nx, ny, nz], matrix, coefficients, name }) {
  if (coefficients !== KIND) throw new Error(`coefficients '${coefficients}' are unknown. Update hemibake-three.`);
  if (matrix.slice(0, 3).some((row, i) => row.slice(0, 3).some((value, j) => i !== j && Math.abs(value) > 1e-6))) {
    throw new Error('three.js shows no rotated grids. Clear the rotation of the volume in Blender.');
  }
  const { image } = await new EXRLoader().setDataType(FloatType).loadAsync(base + encodeURIComponent(file))
    .catch(() => { throw new Error(`'${file}' is not readable. Put it beside the manifest, or bake again.`); });
  if (image.width !== BLOCKS * nx || image.height !== ny * nz) {
    throw new Error(`'${file}' has ${image.width} x ${image.height} pixels instead of ${BLOCKS * nx} x ${ny * nz}. Bake again.`);
  }
  // (x, y, z) of Blender is (x, -z, y) of three.js.
  const [sx, sy, sz] = [0, 1, 2].map(axis => matrix[axis][axis]);
  const grid = new LightProbeGridWebGL(2 * Math.abs(sx), 2 * Math.abs(sz), 2 * Math.abs(sy), nx, nz, ny);
  grid.name = name;
  grid.position.set(matrix[0][3], matrix[2][3], -matrix[1][3]);
  grid.updateBoundingBox();
  const flipped = (index, count, isFlipped) => (isFlipped ? count - 1 - index : index);
  grid.texture = atlas([nx, nz, ny], (x, y, z) => {
    const i = flipped(x, nx, sx < 0), j = flipped(z, ny, sy > 0), k = flipped(y, nz, sz < 0);
    const row = (k * ny + j) * image.width;
    return turned(Array.from({ length: COEFFICIENTS }, (_, block) => {
      const at = 4 * (row + block * nx + i);
      return [...image.data.subarray(at, at + 3)];
    }));
  });
  return grid;
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

// Seven volumes of RGBA along z, each with a copy of its first and last slice: 27 numbers of a probe and a 0.
function atlas([nx, ny, nz], at) {
  const layer = 4 * nx * ny, data = new Uint16Array(layer * 7 * (nz + 2));
  for (let z = -1; z <= nz; z++) {
    for (let i = 0; i < nx * ny; i++) {
      const numbers = at(i % nx, Math.floor(i / nx), Math.min(Math.max(z, 0), nz - 1)).flat();
      for (const [n, value] of numbers.entries()) {
        const volume = Math.floor(n / 4);
        data[(volume * (nz + 2) + z + 1) * layer + 4 * i + n % 4] = DataUtils.toHalfFloat(value);
      }
    }
  }
  const texture = new Data3DTexture(data, nx, ny, 7 * (nz + 2));
  return Object.assign(texture, {
    format: RGBAFormat, type: HalfFloatType, minFilter: LinearFilter, magFilter: LinearFilter, needsUpdate: true,
  });
}
