// Measures the light of probe grids on white surfaces, and sends back linear pixels.

import * as THREE from 'three';
import { loadProbeGrids } from 'hemibake-three';
import { probeSquare } from './probe_square.js';

export async function render({ surfaces, state = '', groups = [], intensity = 1, copies = 0 }) {
  const probes = await loadProbeGrids('/file/hemibake.json'), { grids, problems } = probes;
  if (state) await probes.setState(state);
  for (const [name, color, strength] of groups) probes.setGroup(name, color, strength);
  for (const grid of grids) grid.intensity = intensity;
  const renderer = new THREE.WebGLRenderer(), { scene, square, camera, show } = probeSquare(THREE);
  const target = new THREE.WebGLRenderTarget(1, 1, { type: THREE.FloatType });
  const pixels = new Float32Array(4 * surfaces.length);
  scene.add(...grids);
  for (let i = 0; i < copies; i++) {
    square.material = square.material.clone();
    probes.apply(scene);
  }
  renderer.setRenderTarget(target);
  for (const [i, surface] of surfaces.entries()) {
    show(surface);
    renderer.render(scene, camera);
    renderer.readRenderTargetPixels(target, 0, 0, 1, 1, pixels.subarray(4 * i, 4 * i + 4));
  }
  return { pixels, problems };
}
